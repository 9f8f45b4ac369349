"""Progress of learning the baseline of a bearing."""

from typing import Annotated

import numpy as np
import numpy.typing as npt
from pydantic import Field

from core.baseline.history import DIRECTIONS, ReadingOutcome
from core.change.decision import JUDGED
from core.condition.operating_state import STEADY
from core.units import DAY_NS
from service.api.context import Context
from service.api.values import ApiModel, Time
from service.live.commands import FilmPlace
from service.settings.films import FilmAlarmSettings
from service.store.baselines import BaselineEntry, Versions
from service.store.film_readings import FilmHistory, FilmQuery

RECENT_DAYS = 7.0


class ReadingCountsModel(ApiModel):
    """Counts of recent film readings, which show why a film is not learned or judged."""

    days: Annotated[float, Field(examples=[7.0])]
    """Length of the period whose readings are counted, days."""

    n_at_speed: Annotated[int, Field(examples=[180])]
    """Number of readings at rated speed."""

    n_settled: Annotated[int, Field(examples=[0])]
    """Number of these readings in a settled operating state after the warm-up of the film."""

    n_complete: int
    """Number of settled readings with stiffness, eccentricity and oil temperature, in x or y,
    whichever has fewer."""

    n_judged: int
    """Number of complete readings with a verdict on the film, in x or y, whichever has fewer."""


class LearningModel(ApiModel):
    """Progress of learning the baseline of a bearing."""

    recent: ReadingCountsModel

    since: Time | None
    """Start of the learning period: first reading or last machine event; null without readings."""

    until: Time | None
    """End of the learning period, after which learning stops; null without readings."""

    is_over: bool
    """Whether the learning period has ended."""

    n_readings: int | None
    """Number of usable readings so far; null once this period has a baseline."""

    n_days: Annotated[int | None, Field(examples=[12])]
    """Number of days with usable readings; null once this period has a baseline."""

    n_days_wanted: Annotated[int, Field(examples=[20])]
    """Number of days with usable readings that the first baseline requires."""


def learning_model(
    context: Context, place: FilmPlace, versions: Versions, entries: list[BaselineEntry]
) -> LearningModel:
    """Return the API model of the progress of learning a baseline.

    `versions` is the state of the baseline versions of the bearing, `entries` are all its
    baselines.
    """
    store, settings, now_ns = context.store.films, context.films.settings, context.clock.now_ns()
    film = (place.unit, place.bearing, place.estimator)
    since_ns = store.first_ns(*film) if versions.renewed_ns is None else versions.renewed_ns
    until_ns: int | None = None
    counts: tuple[int, int] | None = (0, 0)
    if since_ns is not None:
        until_ns = since_ns + round(settings.learning_days * DAY_NS)
        learned = [e for e in entries if e.estimator is place.estimator]
        is_learned = any(entry.learned_from_ns >= since_ns for entry in learned)
        period = FilmQuery(*film, since_ns, until_ns + 1)
        counts = None if is_learned else _counts(store.history(period), settings)
    recent = store.history(FilmQuery(*film, now_ns - round(RECENT_DAYS * DAY_NS)))
    return LearningModel.of(
        since=since_ns,
        until=until_ns,
        is_over=until_ns is not None and now_ns >= until_ns,
        n_readings=counts and counts[0],
        n_days=counts and counts[1],
        n_days_wanted=settings.baseline.min_learning_days,
        recent=_recent(recent, settings),
    )


def _counts(found: FilmHistory, settings: FilmAlarmSettings) -> tuple[int, int]:
    """Return `LearningModel.n_readings` and `n_days` of the readings of a learning period."""
    usable = found.is_settled & ~np.any(found.level > 0, axis=0)
    rows = [usable & complete for complete in _complete(found, settings)]
    time_ns = found.history.time_ns
    return min((int(row.sum()), np.unique(time_ns[row] // DAY_NS).size) for row in rows)


def _recent(found: FilmHistory, settings: FilmAlarmSettings) -> ReadingCountsModel:
    n_complete = [(found.is_settled & row).sum() for row in _complete(found, settings)]
    is_judged = np.isin(found.verdict, [int(verdict) for verdict in JUDGED])
    return ReadingCountsModel(
        days=RECENT_DAYS,
        n_at_speed=int(np.isin(found.state, [int(state) for state in STEADY]).sum()),
        n_settled=int(found.is_settled.sum()),
        n_complete=int(min(n_complete)),
        n_judged=int(is_judged[: len(DIRECTIONS)].sum(axis=1).min()),
    )


def _complete(found: FilmHistory, settings: FilmAlarmSettings) -> list[npt.NDArray[np.bool_]]:
    """Return masks of the readings with stiffness and operating condition, (n,) per direction."""
    is_known = settings.baseline.settings().is_known(found.history.conditions)
    return [is_known & (outcome == ReadingOutcome.MEASURED) for outcome in found.history.outcome]
