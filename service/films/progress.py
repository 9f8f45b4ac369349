"""How far learning the baseline of a bearing has come."""

from dataclasses import dataclass

import numpy as np

from core.condition.film_conditions import FilmConditions
from core.stiffness_history import Evidence
from service.films.learning import DAY_NS, FilmPlace
from service.films.versions import Versions
from service.settings.film_alarms import FilmAlarmSettings
from service.store.film_port import BaselineEntry, FilmQuery, FilmStore


@dataclass(frozen=True)
class LearningProgress:
    """How far learning has come.

    Parameters
    ----------
    since_ns, until_ns
        The learning period; None before the first reading.
    n_readings, n_days
        Readings that count so far, in the direction that has fewer, and days that they are from;
        None once there is a baseline of this period.
    """

    since_ns: int | None
    until_ns: int | None
    is_over: bool
    n_readings: int | None
    n_days: int | None


def learning_progress(
    store: FilmStore,
    place: FilmPlace,
    versions: Versions,
    entries: list[BaselineEntry],
    settings: FilmAlarmSettings,
    now_ns: int,
) -> LearningProgress:
    """How far learning has come.

    Parameters
    ----------
    entries
        Every baseline of the bearing.
    """
    since_ns = versions.renewed_ns
    if since_ns is None:
        since_ns = store.first_ns(place.unit, place.bearing, place.estimator)
    if since_ns is None:
        return LearningProgress(None, None, False, 0, 0)
    until_ns = since_ns + round(settings.learning_days * DAY_NS)
    is_learned = any(
        entry.estimator is place.estimator and entry.learned_from_ns >= since_ns
        for entry in entries
    )
    counts = (None, None) if is_learned else _counts(store, place, since_ns, until_ns, settings)
    return LearningProgress(since_ns, until_ns, now_ns >= until_ns, *counts)


def _counts(
    store: FilmStore, place: FilmPlace, since_ns: int, until_ns: int, settings: FilmAlarmSettings
) -> tuple[int, int]:
    """Readings that count, and days that they are from."""
    found = store.history(
        FilmQuery(place.unit, place.bearing, place.estimator, since_ns, until_ns + 1)
    )
    if not len(found):
        return 0, 0
    history = found.history
    usable = found.is_settled & settings.baseline.settings().is_known(FilmConditions.of(history))
    usable &= ~np.any(found.level > 0, axis=0)
    rows = [usable & (evidence == Evidence.MEASURED) for evidence in history.evidence]
    return min((int(row.sum()), np.unique(history.time_ns[row] // DAY_NS).size) for row in rows)
