"""The overview, put together for many clients: what has changed is rendered once for them all."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from threading import Lock

from fastapi import Response

from service.api.alarm_views import alarm_count_model
from service.api.context import Context
from service.api.entity_tags import digest_of, is_known, tag_of
from service.api.film_views import film_brief
from service.api.models import LatestModel
from service.api.plant_models import (
    CapturesModel,
    EvidenceStatusModel,
    OverviewModel,
    PlantModel,
    StoreModel,
    UnitOverviewModel,
)
from service.api.rendering import worked
from service.api.views import latest_model, source_model
from service.live.live_view import UnitStatus
from service.runtime.times import rfc3339

DATA_AGE, AGE, NONE = b'"data_age_s":', b'"age_s":', b"null"

NO_UNITS = b'"units":[]}'

COUNTERS_S = 1.0
"""How old counts of samples may be: they change with every block, many times a second."""

SHARED_S = 0.2
"""How long everybody is given the same answer, unless a link, a result or an alarm is new."""


@dataclass(frozen=True)
class Answer:
    """All of it, as it was put together for whoever asked first."""

    news: tuple[object, ...]
    made_s: float
    tag: str
    body: bytes


@dataclass(frozen=True)
class UnitState:
    """What the part about a unit is made of.

    Parameters
    ----------
    values
        Another object is there as soon as anything is new.
    status
        Another object is there as soon as samples have come.
    ages_s
        Of its newest sample and of each bearing's newest result.
    now_s
        By a clock that never goes back.
    """

    values: Sequence[object]
    status: UnitStatus
    ages_s: Sequence[float | None]
    now_s: float


@dataclass(frozen=True)
class UnitPart:
    """JSON about a unit as it was in a state, with holes where ages belong."""

    state: UnitState
    pieces: Sequence[bytes]
    digest: bytes

    def is_of(self, state: UnitState) -> bool:
        """Whether nothing has changed since; objects are compared, not what is in them."""
        mine = self.state
        if any(old is not new for old, new in zip(mine.values, state.values, strict=True)):
            return False
        return mine.status is state.status or state.now_s - mine.now_s < COUNTERS_S

    def filled(self, ages_s: Sequence[float | None]) -> bytes:
        """The JSON with these ages."""
        first, *others = self.pieces
        ages = (NONE if age_s is None else repr(age_s).encode() for age_s in ages_s)
        return b"".join([first, *(x for pair in zip(ages, others, strict=True) for x in pair)])


class Overview:
    """Keeps the part about each unit until something about that unit is new.

    It is looked at on the event loop, where everything is written; rendering is left to threads.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._parts: dict[str, UnitPart] = {}
        self._latest: dict[tuple[str, str], tuple[Sequence[object], LatestModel]] = {}
        self._rendering = Lock()
        self._answer: Answer | None = None

    async def answer(self, if_none_match: str | None) -> Response:
        """The overview now, or only that it is as the client knows it."""
        news, now_s = self._news(), self._context.clock.monotonic_s()
        kept = self._answer
        if kept is None or kept.news != news or now_s - kept.made_s >= SHARED_S:
            kept = self._answer = await self._put_together(news, now_s)
        if is_known(kept.tag, if_none_match):
            return Response(status_code=304, headers={"ETag": kept.tag})
        return Response(kept.body, media_type="application/json", headers={"ETag": kept.tag})

    def _news(self) -> tuple[object, ...]:
        """Another one as soon as there is something that nobody may be told late."""
        live, alarms, captures = self._context.live, self._context.alarms, self._context.captures
        stored = (live.store_error, live.n_unstored)
        return (live.revision, alarms.revision, *stored, captures.error, captures.n_running)

    async def _put_together(self, news: tuple[object, ...], now_s: float) -> Answer:
        states = {unit: self._state(unit) for unit in self._context.units}
        head = self._head()
        if any(self._is_old(unit, state) for unit, state in states.items()):
            await worked(lambda: self._renew(states))
        parts = [self._parts[unit] for unit in states]
        without_time = head.model_copy(update={"time": ""}).model_dump_json().encode()
        tag = tag_of(digest_of(without_time), *(part.digest for part in parts))
        units = [p.filled(s.ages_s) for p, s in zip(parts, states.values(), strict=True)]
        body = head.model_dump_json().encode().removesuffix(NO_UNITS)
        return Answer(news, now_s, tag, body + b'"units":[' + b",".join(units) + b"]}")

    def _state(self, unit: str) -> UnitState:
        live, films = self._context.live, self._context.films
        bearings = [bearing.id for bearing in self._context.units[unit].bearing]
        found = [live.current(unit, bearing) for bearing in bearings]
        status = live.status(unit)
        values: list[object] = [status.state, status.reason, status.stamp_fault]
        for bearing, current in zip(bearings, found, strict=True):
            values += (current.assessment, current.quality.reason, current.is_current)
            values += (films.newest(unit, bearing), films.baseline(unit, bearing))
        ages_s = [live.data_age_s(unit), *(current.age_s for current in found)]
        return UnitState(values, status, ages_s, self._context.clock.monotonic_s())

    def _is_old(self, unit: str, state: UnitState) -> bool:
        part = self._parts.get(unit)
        return part is None or not part.is_of(state)

    def _renew(self, states: Mapping[str, UnitState]) -> None:
        with self._rendering:  # what one client waits for, the next one finds done
            for unit, state in states.items():
                if self._is_old(unit, state):
                    self._parts[unit] = self._part(unit, state)

    def _part(self, unit: str, state: UnitState) -> UnitPart:
        context, settings = self._context, self._context.units[unit]
        source = source_model(context.live, unit).model_copy(update={"data_age_s": None})
        model = UnitOverviewModel(
            id=unit,
            name=settings.name,
            rated_speed_rpm=settings.rated_speed_rpm,
            source=source,
            bearings=[self._ageless(unit, bearing.id) for bearing in settings.bearing],
            films=[film_brief(context, unit, bearing.id) for bearing in settings.bearing],
        )
        content = model.model_dump_json().encode()
        return UnitPart(state, _around_ages(content), digest_of(content))

    def _ageless(self, unit: str, bearing: str) -> LatestModel:
        """A bearing now, made anew only after a new result."""
        current = self._context.live.current(unit, bearing)
        values = (current.assessment, current.quality.reason)
        kept = self._latest.get((unit, bearing))
        if kept is None or any(new is not old for new, old in zip(values, kept[0], strict=True)):
            latest = latest_model(self._context.live, unit, bearing)
            kept = (values, latest.model_copy(update={"age_s": None}))
            self._latest[unit, bearing] = kept
        return kept[1]

    def _head(self) -> OverviewModel:
        """Everything but the units."""
        context = self._context
        return OverviewModel(
            plant=PlantModel(name=context.plant_name, origin=context.origin.value),
            time=rfc3339(context.clock.now_ns()),
            refresh_s=context.refresh_s,
            store=StoreModel(error=context.live.store_error, n_unstored=context.live.n_unstored),
            alarms=alarm_count_model(context.alarms),
            captures=CapturesModel(
                error=context.captures.error,
                n_running=context.captures.n_running,
                n_written=context.captures.n_written,
            ),
            evidence=_evidence(context),
            units=[],
        )


def _around_ages(content: bytes) -> list[bytes]:
    """What stands around the ages about a unit, which are all null: its source's comes first."""
    source, bearings = content.split(DATA_AGE + NONE, 1)
    *before, last = bearings.split(AGE + NONE)
    return [source + DATA_AGE, *(piece + AGE for piece in before), last]


def _evidence(context: Context) -> EvidenceStatusModel | None:
    if context.evidence is None:
        return None
    status = context.evidence()
    return EvidenceStatusModel(
        error=status.error,
        n_waiting=status.n_waiting,
        n_written=status.n_written,
        n_lost=status.n_lost,
    )
