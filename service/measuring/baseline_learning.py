"""Learning the films of a unit from stored readings, and whether to believe what was learned."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from core.arrays import TimeArray
from core.baseline.agreement import far_readings, learning_drift, mean_difference
from core.baseline.baseline import BearingBaseline, Origin
from core.baseline.history import StiffnessHistory
from core.baseline.learning import learn
from core.change.settings import FilmRules
from core.change.shaft_response import ShaftResponse, learn_response
from core.units import DAY_NS
from service.live.commands import FilmPlace
from service.settings.films import FilmAlarmSettings
from service.store.baselines import BaselineStep, StoredStep, Versions, versions_after
from service.store.film_readings import FilmHistory, FilmQuery
from service.store.films import FilmStore

PADWATCH = "padwatch"
"""Who learns, and accepts where engineers leave it to padwatch."""

SURE = 3.0
"""Standard uncertainties of a drift that is none by chance."""


class Learner:
    """Learns baselines; holds nothing between calls, and may be used in any thread."""

    def __init__(self, store: FilmStore, settings: FilmAlarmSettings) -> None:
        self._store, self._settings = store, settings

    def is_due(self, place: FilmPlace, now_ns: int) -> bool:
        """Whether it is time to learn a bearing (again)."""
        versions = self.versions(place)
        since_ns = self._since_ns(place, versions)
        if versions.is_frozen or since_ns is None:
            return False
        newest = next(
            (
                entry
                for entry in self._store.baselines(place.unit, place.bearing)
                if entry.estimator is place.estimator and entry.created_ns >= since_ns
            ),
            None,
        )
        if newest is None:
            return now_ns - since_ns >= self._settings.baseline.min_learning_days * DAY_NS
        until_ns = since_ns + round(self._settings.learning_days * DAY_NS)
        if newest.learned_until_ns >= until_ns or newest.created_ns > until_ns:
            return False
        return now_ns - newest.created_ns >= self._settings.learn_every_days * DAY_NS

    def versions(self, place: FilmPlace) -> Versions:
        """Where the baselines of a bearing stand."""
        return versions_after(self._store.steps(place.unit, place.bearing))

    def learn(
        self, place: FilmPlace, now_ns: int, author: str = PADWATCH, reason: str = ""
    ) -> BearingBaseline | None:
        """Learn a bearing, store what was learned, and put it in force where that is padwatch's.

        Returns
        -------
        None if there are too few readings.
        """
        versions = self.versions(place)
        found = self._readings(place, versions, now_ns)
        if not len(found):
            return None
        is_healthy = found.is_settled & ~np.any(found.level > 0, axis=0)
        baseline = learn(
            found.history,
            is_healthy,
            self._origin(place, now_ns, author, reason),
            self._settings.baseline.settings(self._settings.reading_h),
        )
        if not baseline.quantities:
            return None
        limit = self._settings.change.alert_change
        doubt = drifted(found.history, is_healthy, baseline, limit)
        doubt = doubt or self._disagreement(baseline, versions)
        far = far_readings(found.history, is_healthy, baseline)
        self._store.add_baseline(baseline, self._steps(baseline, doubt, far))
        return baseline

    def learn_response(self, unit: str, rules: FilmRules, now_ns: int) -> ShaftResponse | None:
        """Learn how a unit's shaft answers to its films, and store it."""
        places = [FilmPlace(unit, *item) for item in rules.estimators.items()]
        found = {p.bearing: self._readings(p, self.versions(p), now_ns) for p in places}
        histories, is_settled = at_same_times(found)
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

    def _origin(self, place: FilmPlace, now_ns: int, author: str, reason: str) -> Origin:
        entries = self._store.baselines(place.unit, place.bearing)
        version = 1 + max((entry.version for entry in entries), default=0)
        return Origin(
            place.unit, place.bearing, place.estimator.value, version, author, now_ns, reason
        )

    def _steps(
        self, baseline: BearingBaseline, doubt: str | None, far: str | None
    ) -> list[StoredStep]:
        noticed = "; ".join(filter(None, (doubt, far))) or baseline.origin.event
        steps = [_step(baseline, BaselineStep.LEARNED, noticed)]
        if self._settings.acceptance == "automatic" and doubt is None:
            steps.append(_step(baseline, BaselineStep.ACCEPTED, "nothing speaks against it"))
        return steps

    def _disagreement(self, baseline: BearingBaseline, versions: Versions) -> str | None:
        """How it differs from the first that was accepted, if it does.

        From the first and not from the last: a film that softens slowly would be learned little by
        little.
        """
        origin = baseline.origin
        if versions.first_accepted is None:
            return None
        first = self._store.baseline(origin.unit, origin.bearing, versions.first_accepted)
        if first is None or first.origin.estimator != origin.estimator:
            return "learned with another estimator than the first"
        worst = max(mean_difference(first, baseline).values(), key=abs, default=0.0)
        if abs(worst) < self._settings.change.alert_change:
            return None
        return f"{100 * worst:+.1f} % from version {versions.first_accepted} under like conditions"


def drifted(
    history: StiffnessHistory,
    is_healthy: npt.NDArray[np.bool_],
    baseline: BearingBaseline,
    limit: float,
) -> str | None:
    """By how much films changed while they were learned, if they did: a fault may be in it."""
    for quantity in baseline.quantities:
        found = learning_drift(history, is_healthy, quantity)
        if found and abs(found.change) >= max(limit, SURE * found.std):
            return (
                f"{quantity.direction} changed by {100 * found.change:+.1f} %"
                f" ± {200 * found.std:.1f} % under like conditions while it was learned"
            )
    return None


def _step(baseline: BearingBaseline, step: BaselineStep, reason: str) -> StoredStep:
    origin = baseline.origin
    return StoredStep(
        origin.unit,
        origin.bearing,
        origin.version,
        step,
        origin.created_ns,
        origin.author,
        reason,
    )


def at_same_times(
    found: Mapping[str, FilmHistory],
) -> tuple[dict[str, StiffnessHistory], npt.NDArray[np.bool_]]:
    """Histories of all bearings where all have a reading, and whether the unit had settled."""
    common = common_times([history.history.time_ns for history in found.values()])
    histories, settled = {}, np.ones(common.size, np.bool_)
    for bearing, film in found.items():
        rows = np.isin(film.history.time_ns, common)
        histories[bearing] = film.history.where(rows)
        settled &= (film.is_settled & ~np.any(film.level > 0, axis=0))[rows]
    return histories, settled


def common_times(times_ns: Sequence[TimeArray]) -> TimeArray:
    """Times that all have, each of them increasing."""
    common = times_ns[0]
    for other in times_ns[1:]:
        common = np.intersect1d(common, other, assume_unique=True)
    return common
