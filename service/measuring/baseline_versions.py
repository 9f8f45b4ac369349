"""The version of a baseline in force, and resuming films after a start."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from core.arrays import FloatArray
from core.baseline.baseline import BearingBaseline
from core.baseline.history import DIRECTIONS, StiffnessHistory, Watched
from core.change.backtest import last_decision, last_operation
from core.change.decision import INITIAL_DECISION, Decision
from core.change.film_judge import MAX_RECENT
from core.change.settings import FilmRules
from core.change.shaft_response import ShaftResponse
from core.condition.operating_state import OilSettling, Operation
from core.units import NS_PER_S
from service.live.commands import FilmPlace
from service.measuring.baseline_learning import common_times
from service.store.baselines import versions_after
from service.store.film_readings import FilmHistory, FilmQuery
from service.store.films import FilmStore

TAIL_NS = 2 * 86_400 * NS_PER_S
"""How far operation is looked back on: longer than warming up."""

CATCH_UP_NS = 21 * 86_400 * NS_PER_S
"""How far decisions are: several times the longest mean."""


@dataclass(frozen=True)
class InForce:
    """What a bearing is compared with, and where its decisions stand; all empty without one."""

    baseline: BearingBaseline | None = None
    decisions: tuple[Decision, ...] = ()


def in_force(store: FilmStore, place: FilmPlace, rules: FilmRules) -> InForce:
    """The baseline of a bearing that is in force, and its decisions so far."""
    version = versions_after(store.steps(place.unit, place.bearing)).in_force
    if version is None:
        return InForce()
    baseline = store.baseline(place.unit, place.bearing, version)
    if baseline is None or baseline.origin.estimator != place.estimator:
        return InForce()
    stored = [
        found.decision
        for found in store.decisions(place.unit, place.bearing)
        if (found.baseline_version, found.estimator) == (version, place.estimator)
    ]
    if len(stored) == 2:
        return InForce(baseline, tuple(stored))
    return InForce(baseline, caught_up(store, place, rules, baseline))


def caught_up(
    store: FilmStore, place: FilmPlace, rules: FilmRules, baseline: BearingBaseline
) -> tuple[Decision, ...]:
    """Decisions x and y as if a baseline had been in force for the newest readings."""
    newest_ns = _newest_ns(store, place)
    start_ns = newest_ns - round(CATCH_UP_NS / rules.time_lapse)
    found = store.history(FilmQuery(place.unit, place.bearing, place.estimator, start_ns))
    learned = (baseline.of(Watched.STIFFNESS, direction) for direction in DIRECTIONS)
    return tuple(
        last_decision(found.history, found.is_settled, quantity, rules)
        if quantity
        else INITIAL_DECISION
        for quantity in learned
    )


@dataclass(frozen=True)
class UnitStart:
    """Where the films of a unit go on.

    Parameters
    ----------
    oil, bearings
        By bearing.
    recent
        Newest readings, as `FilmJudge.add_recent` takes them.
    """

    operation: Operation
    oil: dict[str, OilSettling]
    bearings: dict[str, InForce]
    recent: list[FloatArray]
    response: ShaftResponse | None


def unit_start(
    store: FilmStore, unit: str, rules: FilmRules, response: ShaftResponse | None
) -> UnitStart:
    """Where the films of a unit go on after everything that is stored."""
    places = [FilmPlace(unit, *item) for item in rules.estimators.items()]
    newest_ns = _newest_ns(store, places[0])
    found = {
        place.bearing: store.history(
            FilmQuery(unit, place.bearing, place.estimator, newest_ns - TAIL_NS)
        )
        for place in places
    }
    seen = {bearing: last_operation(film.history, rules) for bearing, film in found.items()}
    bearings = {place.bearing: in_force(store, place, rules) for place in places}
    return UnitStart(
        seen[places[0].bearing][0],
        {bearing: oil for bearing, (_, oil) in seen.items()},
        bearings,
        _recent(found, bearings),
        response,
    )


def _newest_ns(store: FilmStore, place: FilmPlace) -> int:
    newest = store.history(FilmQuery(place.unit, place.bearing, place.estimator, newest=1))
    return int(newest.history.time_ns[-1]) if len(newest) else 0


def _recent(found: Mapping[str, FilmHistory], bearings: Mapping[str, InForce]) -> list[FloatArray]:
    """Newest settled readings at the same times, (5, n_films) each."""
    common = common_times([history.history.time_ns for history in found.values()])
    columns, settled = [], np.ones(common.size, np.bool_)
    for bearing, film in found.items():
        rows = np.isin(film.history.time_ns, common)
        settled &= film.is_settled[rows]
        history, baseline = film.history.where(rows), bearings[bearing].baseline
        shaft = np.where(history.shaft_um_pk > 0.0, history.shaft_um_pk, np.nan)
        attitude = np.stack([history.attitude_deg] * 2)
        rows_of = (history.ln_k, np.log(shaft), film.deviation[:, rows])
        columns.append(np.stack([*rows_of, _rises(history, baseline), attitude]))
    whole = np.concatenate(columns, axis=1)[:, :, settled]
    return [whole[:, :, i] for i in range(max(0, whole.shape[2] - MAX_RECENT), whole.shape[2])]


def _rises(history: StiffnessHistory, baseline: BearingBaseline | None) -> FloatArray:
    """(2, n) rise of the baseline with eccentricity; NaN where there is none."""
    rises = np.full((len(DIRECTIONS), len(history)), np.nan)
    for row, direction in enumerate(DIRECTIONS):
        learned = baseline.of(Watched.STIFFNESS, direction) if baseline else None
        if learned is not None:
            rises[row] = learned.eccentricity_rise(history.conditions)
    return rises
