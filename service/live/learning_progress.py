"""Progress of learning the baseline of a bearing."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.baseline.history import DIRECTIONS, ReadingOutcome
from core.change.decision import JUDGED
from core.condition.operating_state import STEADY
from core.units import DAY_NS
from service.live.commands import FilmPlace
from service.settings.films import FilmAlarmSettings
from service.store.baselines import BaselineEntry, Versions
from service.store.film_readings import FilmHistory, FilmQuery
from service.store.films import FilmStore

RECENT_DAYS = 7.0


@dataclass(frozen=True)
class ReadingCounts:
    """Numbers of stiffness readings of a film in the last `RECENT_DAYS` days, by usability.

    Parameters
    ----------
    n_at_speed
        Readings at rated speed, at any load.
    n_settled
        Readings in a settled operating state.
    n_complete
        Settled readings with stiffness and operating condition, in the direction (x or y) with
        fewer such readings.
    n_judged
        Readings with a verdict on the film, in the direction with fewer such readings.
    """

    n_at_speed: int
    n_settled: int
    n_complete: int
    n_judged: int


@dataclass(frozen=True)
class LearningProgress:
    """Progress of learning the baseline of a bearing.

    Parameters
    ----------
    since_ns, until_ns
        Start and end of the learning period, UTC nanoseconds; None before the first reading.
    is_over
        Whether the learning period has ended.
    n_readings, n_days
        Number of usable readings, and of days with such readings, in the direction (x or y) with
        fewer readings; None after a baseline was learned in this period.
    recent
        Numbers of readings in the last `RECENT_DAYS` days.
    """

    since_ns: int | None
    until_ns: int | None
    is_over: bool
    n_readings: int | None
    n_days: int | None
    recent: ReadingCounts


def learning_progress(
    store: FilmStore,
    place: FilmPlace,
    versions: Versions,
    entries: list[BaselineEntry],
    settings: FilmAlarmSettings,
    now_ns: int,
) -> LearningProgress:
    """Return the progress of learning a baseline; ``entries`` are all baselines of the bearing."""
    recent = _recent(store, place, settings, now_ns)
    since_ns = versions.renewed_ns
    if since_ns is None:
        since_ns = store.first_ns(place.unit, place.bearing, place.estimator)
    if since_ns is None:
        return LearningProgress(None, None, False, 0, 0, recent)
    until_ns = since_ns + round(settings.learning_days * DAY_NS)
    is_learned = any(
        entry.estimator is place.estimator and entry.learned_from_ns >= since_ns
        for entry in entries
    )
    n_readings, n_days = (
        (None, None) if is_learned else _counts(store, place, since_ns, until_ns, settings)
    )
    is_over = now_ns >= until_ns
    return LearningProgress(since_ns, until_ns, is_over, n_readings, n_days, recent)


def _counts(
    store: FilmStore, place: FilmPlace, since_ns: int, until_ns: int, settings: FilmAlarmSettings
) -> tuple[int, int]:
    """Return `LearningProgress.n_readings` and `n_days` over a learning period."""
    found = store.history(
        FilmQuery(place.unit, place.bearing, place.estimator, since_ns, until_ns + 1)
    )
    if not len(found):
        return 0, 0
    usable = found.is_settled & ~np.any(found.level > 0, axis=0)
    rows = [usable & complete for complete in _complete(found, settings)]
    time_ns = found.history.time_ns
    return min((int(row.sum()), np.unique(time_ns[row] // DAY_NS).size) for row in rows)


def _recent(
    store: FilmStore, place: FilmPlace, settings: FilmAlarmSettings, now_ns: int
) -> ReadingCounts:
    since_ns = now_ns - round(RECENT_DAYS * DAY_NS)
    found = store.history(FilmQuery(place.unit, place.bearing, place.estimator, since_ns))
    if not len(found):
        return ReadingCounts(0, 0, 0, 0)
    is_judged = np.isin(found.verdict, [int(verdict) for verdict in JUDGED])
    return ReadingCounts(
        int(np.isin(found.state, [int(state) for state in STEADY]).sum()),
        int(found.is_settled.sum()),
        min(int((found.is_settled & row).sum()) for row in _complete(found, settings)),
        int(is_judged[: len(DIRECTIONS)].sum(axis=1).min()),
    )


def _complete(found: FilmHistory, settings: FilmAlarmSettings) -> list[npt.NDArray[np.bool_]]:
    """Return masks of the readings with stiffness and operating condition, (n,) per direction."""
    is_known = settings.baseline.settings().is_known(found.history.conditions)
    return [is_known & (outcome == ReadingOutcome.MEASURED) for outcome in found.history.outcome]
