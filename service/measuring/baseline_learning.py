"""Learning of baselines, and changes of their versions."""

from collections.abc import Callable, Mapping
from functools import partial, reduce

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.agreement import far_readings, learning_drift, mean_difference
from core.baseline.baseline import BearingBaseline, Origin
from core.baseline.history import DIRECTIONS, QUANTITIES, StiffnessHistory
from core.baseline.learning import learn
from core.change.backtest import last_decision, last_operation
from core.change.decision import INITIAL_DECISION, Decision
from core.change.film_judge import MAX_RECENT
from core.change.film_watch import FilmWatch
from core.change.settings import FilmRules, percent_of
from core.change.shaft_response import ShaftResponse, learn_response
from core.units import DAY_NS
from service.live.commands import FilmPlace
from service.settings.films import FilmAlarmSettings
from service.store.baselines import BaselineStep, StoredStep, Versions, versions_after
from service.store.film_readings import FilmHistory, FilmQuery
from service.store.films import FilmStore

TAIL_NS = 7 * DAY_NS
"""Length, ns, of the history from which the operating state and the readings that show causes are
restored; exceeds the warm-up, and `MAX_RECENT` readings of a unit that runs."""

CATCH_UP_NS = 21 * DAY_NS
"""Length of the history from which decisions are computed, ns; a multiple of the longest mean."""


def places_of(unit: str, rules: FilmRules) -> list[FilmPlace]:
    """Return the monitored bearings of a unit with the estimators of their stiffness."""
    return [FilmPlace(unit, bearing, each) for bearing, each in rules.estimators.items()]


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
        each.decision
        for each in store.decisions(place.unit, place.bearing)
        if (each.baseline_version, each.estimator) == (version, place.estimator)
    ]
    if len(stored) == len(QUANTITIES):
        return baseline, tuple(stored)
    # computed from the newest readings with a new baseline
    start_ns = _newest_ns(store, place) - round(CATCH_UP_NS / rules.time_lapse)
    found = store.history(FilmQuery(place.unit, place.bearing, place.estimator, start_ns))
    learned = (baseline.of(name) for name in QUANTITIES)
    return baseline, tuple(
        last_decision(found.history, found.is_settled, quantity, rules)
        if quantity
        else INITIAL_DECISION
        for quantity in learned
    )


def resume_films(
    store: FilmStore, unit: str, rules: FilmRules, response: ShaftResponse | None, watch: FilmWatch
) -> None:
    """Restore the film monitor ``watch`` of a unit from stored readings, decisions and response."""
    places = places_of(unit, rules)
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

    Rows are those of `UnitReadings.of`; rises are d ln(stiffness) / d ln(eccentricity ratio).
    """
    common, columns = common_rows(found), []
    settled = np.logical_and.reduce([film.is_settled[common[b]] for b, film in found.items()])
    for bearing, film in found.items():
        history = film.history.where(common[bearing])
        shaft = np.where(history.shaft_um_pk > 0.0, history.shaft_um_pk, np.nan)
        attitude = np.stack([history.attitude_deg] * 2)
        deviation = film.deviation[: len(DIRECTIONS), common[bearing]]
        baseline = watch.judge.baseline(bearing)
        rises = np.full((len(DIRECTIONS), len(history)), np.nan)  # without a baseline
        for row, direction in enumerate(DIRECTIONS):
            learned = baseline.of(f"k_{direction}") if baseline else None
            if learned is not None:
                rises[row] = learned.eccentricity_rise(history.conditions)
        motion = [part for each in history.motion_um for part in (each.real, each.imag)]
        columns.append(np.stack([history.ln_k, np.log(shaft), deviation, rises, attitude, *motion]))
    whole = np.concatenate(columns, axis=1)[:, :, settled]
    return [whole[:, :, i] for i in range(max(0, whole.shape[2] - MAX_RECENT), whole.shape[2])]


PADWATCH = "padwatch"
"""Author of baselines that are learned and accepted automatically."""

SURE = 3.0
"""Minimum ratio of a drift to its standard uncertainty; a smaller drift may be chance."""


class Learner:
    """Learner of baselines and shaft responses from stored readings; stateless and thread-safe."""

    def __init__(self, store: FilmStore, settings: FilmAlarmSettings) -> None:
        self._store, self._settings = store, settings

    def is_due(self, place: FilmPlace, now_ns: int) -> bool:
        """Return whether the first baseline of a bearing, or a new version of it, is due.

        `now_ns` is the host time, ns since 1970 UTC.
        """
        versions = self.versions(place)
        since_ns = self._since_ns(place, versions)
        if versions.is_frozen or since_ns is None:
            return False
        entries = self._store.baselines(place.unit, place.bearing)
        own = (each for each in entries if each.estimator is place.estimator)
        newest = next((entry for entry in own if entry.created_ns >= since_ns), None)
        if newest is None:
            return now_ns - since_ns >= self._settings.baseline.min_learning_days * DAY_NS
        until_ns = since_ns + round(self._settings.learning_days * DAY_NS)
        if newest.learned_until_ns >= until_ns or newest.created_ns > until_ns:
            return False
        return now_ns - newest.created_ns >= self._settings.learn_every_days * DAY_NS

    def versions(self, place: FilmPlace) -> Versions:
        """Return the state of a bearing's baseline versions."""
        return versions_after(self._store.steps(place.unit, place.bearing))

    def learn(self, place: FilmPlace, now_ns: int) -> BearingBaseline | None:
        """Learn and store a baseline; put it in force if this is automatic and all checks pass.

        `now_ns` is the host time, ns since 1970 UTC.

        Returns
        -------
        The learned baseline; None if there are too few readings.
        """
        versions = self.versions(place)
        found = self._readings(place, versions, now_ns)
        if not len(found):
            return None
        is_healthy = healthy(found)
        entries = self._store.baselines(place.unit, place.bearing)
        version = 1 + max((entry.version for entry in entries), default=0)
        whose = (place.unit, place.bearing)
        origin = Origin(*whose, place.estimator.value, version, PADWATCH, now_ns)
        settings = self._settings.baseline.settings(self._settings.reading_h)
        baseline = learn(found.history, is_healthy, origin, settings)
        if not baseline.quantities:
            return None
        doubt = drifted(found.history, is_healthy, baseline, self._settings.alert_change)
        doubt = doubt or self._disagreement(baseline, versions)
        far = far_readings(found.history, is_healthy, baseline)
        noticed = "; ".join(filter(None, (doubt, far)))
        made = partial(StoredStep, *whose, version, time_ns=now_ns, actor=PADWATCH)
        steps = [made(step=BaselineStep.LEARNED, reason=noticed)]
        if self._settings.acceptance == "automatic" and doubt is None:
            steps.append(made(step=BaselineStep.ACCEPTED, reason="no objection found"))
        self._store.add_baseline(baseline, steps)
        return baseline

    def learn_response(self, unit: str, rules: FilmRules, now_ns: int) -> ShaftResponse | None:
        """Learn and store how the shaft motion of a unit responds to film stiffness.

        `now_ns` is the host time, ns since 1970 UTC; later readings are not used.

        Returns
        -------
        The response; None if there are too few readings at times common to all bearings.
        """
        places = places_of(unit, rules)
        found = {p.bearing: self._readings(p, self.versions(p), now_ns) for p in places}
        rows = common_rows(found)
        histories = {bearing: film.history.where(rows[bearing]) for bearing, film in found.items()}
        is_settled = np.logical_and.reduce([healthy(f)[rows[b]] for b, f in found.items()])
        if not is_settled.size:
            return None
        response = learn_response(histories, is_settled)
        if response is not None:
            self._store.set_response(unit, response, now_ns)
        return response

    def _since_ns(self, place: FilmPlace, versions: Versions) -> int | None:
        if versions.renewed_ns is not None:
            return versions.renewed_ns
        return self._store.first_ns(place.unit, place.bearing, place.estimator)

    def _readings(self, place: FilmPlace, versions: Versions, now_ns: int) -> FilmHistory:
        since_ns = self._since_ns(place, versions) or 0
        until_ns = min(now_ns, since_ns + round(self._settings.learning_days * DAY_NS))
        return self._store.history(
            FilmQuery(place.unit, place.bearing, place.estimator, since_ns, until_ns + 1)
        )

    def _disagreement(self, baseline: BearingBaseline, versions: Versions) -> str | None:
        """Describe the difference from the first accepted baseline; None if it is small.

        A comparison with the previous version would accept a film that softens slowly.
        """
        origin = baseline.origin
        if versions.first_accepted is None:
            return None
        first = self._store.baseline(origin.unit, origin.bearing, versions.first_accepted)
        if first is None or first.origin.estimator != origin.estimator:
            return "learned with another estimator than the first accepted version"
        for name, found in mean_difference(first, baseline).items():
            if abs(percent_of(found)) >= 100.0 * self._settings.alert_change(name):
                size = f"{abs(percent_of(found)):.1f} % {'above' if found > 0.0 else 'below'}"
                since = f"version {versions.first_accepted} under like conditions"
                return f"{QUANTITIES[name].label} is {size} that of {since}"
        return None


def drifted(
    history: StiffnessHistory,
    is_healthy: npt.NDArray[np.bool_],
    baseline: BearingBaseline,
    limit: Callable[[str], float],
) -> str | None:
    """Describe a change of a quantity during learning, which may be a fault of the bearing.

    Return None if no change is significant and above ``limit``, a function from the name of a
    quantity to its limit as a fraction. ``is_healthy`` (n,) marks the readings to use.
    """
    for quantity in baseline.quantities:
        found = learning_drift(history, is_healthy, quantity)
        if found is None or abs(found.change) < SURE * found.std:
            continue
        change = percent_of(found.change)
        if abs(change) >= 100.0 * limit(quantity.quantity):
            return (
                f"{QUANTITIES[quantity.quantity].label} {'rose' if change > 0.0 else 'fell'} by"
                f" {abs(change):.1f} ± {200 * found.std:.1f} % under like conditions while learning"
            )
    return None


def healthy(film: FilmHistory) -> npt.NDArray[np.bool_]:
    """Return a mask (n,) of the readings in a settled operating state without an alarm."""
    is_healthy: npt.NDArray[np.bool_] = film.is_settled & ~np.any(film.level > 0, axis=0)
    return is_healthy


def common_rows(found: Mapping[str, FilmHistory]) -> dict[str, npt.NDArray[np.bool_]]:
    """Return the mask (n,) of the readings at times common to all histories, by bearing id.

    `found` are the histories of the films by bearing id.
    """
    times = {bearing: film.history.time_ns for bearing, film in found.items()}
    common = reduce(partial(np.intersect1d, assume_unique=True), times.values())
    return {bearing: np.isin(time_ns, common) for bearing, time_ns in times.items()}
