"""Lookup of the baseline in force, and restoring of the film state after a start."""

from collections.abc import Mapping

import numpy as np

from core.arrays import FloatArray
from core.baseline.baseline import BearingBaseline
from core.baseline.history import DIRECTIONS, QUANTITIES, StiffnessHistory
from core.change.backtest import last_decision, last_operation
from core.change.decision import INITIAL_DECISION, Decision
from core.change.film_judge import MAX_RECENT
from core.change.film_watch import FilmWatch
from core.change.settings import FilmRules
from core.change.shaft_response import ShaftResponse
from core.units import DAY_NS
from service.live.commands import FilmPlace
from service.measuring.baseline_learning import common_rows
from service.store.baselines import versions_after
from service.store.film_readings import FilmHistory, FilmQuery
from service.store.films import FilmStore

TAIL_NS = 2 * DAY_NS
"""Length, ns, of the history from which the operating state is computed; exceeds the warm-up."""

CATCH_UP_NS = 21 * DAY_NS
"""Length of the history from which decisions are computed, ns; a multiple of the longest mean."""


def in_force(
    store: FilmStore, place: FilmPlace, rules: FilmRules
) -> tuple[BearingBaseline | None, tuple[Decision, ...]]:
    """Return the baseline in force for a bearing, and its newest decision for each quantity.

    Return None and an empty tuple if no baseline for the estimator of ``place`` is in force.
    """
    version = versions_after(store.steps(place.unit, place.bearing)).in_force
    baseline = None if version is None else store.baseline(place.unit, place.bearing, version)
    if baseline is None or baseline.origin.estimator != place.estimator:
        return None, ()
    stored = [
        found.decision
        for found in store.decisions(place.unit, place.bearing)
        if (found.baseline_version, found.estimator) == (version, place.estimator)
    ]
    if len(stored) == len(QUANTITIES):
        return baseline, tuple(stored)
    return baseline, _decisions(store, place, rules, baseline)


def _decisions(
    store: FilmStore, place: FilmPlace, rules: FilmRules, baseline: BearingBaseline
) -> tuple[Decision, ...]:
    """Return the decisions computed from the newest readings with a new baseline."""
    start_ns = _newest_ns(store, place) - round(CATCH_UP_NS / rules.time_lapse)
    found = store.history(FilmQuery(place.unit, place.bearing, place.estimator, start_ns))
    learned = (baseline.of(name) for name in QUANTITIES)
    return tuple(
        last_decision(found.history, found.is_settled, quantity, rules)
        if quantity
        else INITIAL_DECISION
        for quantity in learned
    )


def resume_films(
    store: FilmStore,
    unit: str,
    rules: FilmRules,
    response: ShaftResponse | None,
    watch: FilmWatch,
) -> None:
    """Restore the film monitor ``watch`` of a unit from stored readings, decisions and response."""
    places = [FilmPlace(unit, *item) for item in rules.estimators.items()]
    start_ns = _newest_ns(store, places[0]) - TAIL_NS
    found = {
        place.bearing: store.history(FilmQuery(unit, place.bearing, place.estimator, start_ns))
        for place in places
    }
    seen = {bearing: last_operation(film.history, rules) for bearing, film in found.items()}
    operation = seen[places[0].bearing][0]
    watch.restore_operation(operation, {bearing: oil for bearing, (_, oil) in seen.items()})
    for place in places:
        watch.judge.activate_baseline(place.bearing, *in_force(store, place, rules))
    watch.judge.add_recent(_recent(found, watch))
    watch.judge.response = response


def _newest_ns(store: FilmStore, place: FilmPlace) -> int:
    newest = store.history(FilmQuery(place.unit, place.bearing, place.estimator, newest=1))
    return int(newest.history.time_ns[-1]) if len(newest) else 0


def _recent(found: Mapping[str, FilmHistory], watch: FilmWatch) -> list[FloatArray]:
    """Return the newest settled readings at times common to all bearings, (9, n_films) each.

    Rows are those of `UnitReadings.of`.
    """
    common, columns = common_rows(found), []
    settled = np.logical_and.reduce([film.is_settled[common[b]] for b, film in found.items()])
    for bearing, film in found.items():
        history = film.history.where(common[bearing])
        shaft = np.where(history.shaft_um_pk > 0.0, history.shaft_um_pk, np.nan)
        attitude = np.stack([history.attitude_deg] * 2)
        deviation = film.deviation[: len(DIRECTIONS), common[bearing]]
        rises = _rises(history, watch.judge.baseline(bearing))
        motion = [part for each in history.motion_um for part in (each.real, each.imag)]
        columns.append(np.stack([history.ln_k, np.log(shaft), deviation, rises, attitude, *motion]))
    whole = np.concatenate(columns, axis=1)[:, :, settled]
    return [whole[:, :, i] for i in range(max(0, whole.shape[2] - MAX_RECENT), whole.shape[2])]


def _rises(history: StiffnessHistory, baseline: BearingBaseline | None) -> FloatArray:
    """Return d ln(stiffness) / d ln(eccentricity ratio), (2, n); NaN without a baseline."""
    rises = np.full((len(DIRECTIONS), len(history)), np.nan)
    for row, direction in enumerate(DIRECTIONS):
        learned = baseline.of(f"k_{direction}") if baseline else None
        if learned is not None:
            rises[row] = learned.eccentricity_rise(history.conditions)
    return rises
