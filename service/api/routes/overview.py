"""Route for the overview of the plant; one rendered answer serves all clients."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Literal

from fastapi import APIRouter, Response

from service.api.answers import digest_of, in_thread, tag_of
from service.api.auth.declared import subject_router
from service.api.context import Context
from service.api.routes.alarm_models import AlarmCountModel
from service.api.routes.bearings import LatestModel, latest_model
from service.api.routes.films import FilmBriefModel, film_brief
from service.api.routes.plant import BasicUnitModel, source_model
from service.api.values import ApiModel, DatedAnswer
from service.live.live_view import UnitStatus


class EvidenceStatusModel(ApiModel):
    """State of the writing of alarm evidence."""

    error: str | None
    """Reason why the newest attempt to write evidence failed; null if it succeeded."""

    n_waiting: int
    """Number of alarm occurrences whose evidence is not written yet."""

    n_written: int
    """Number of alarm occurrences whose evidence was written since the service started."""

    n_lost: int
    """Number of alarm occurrences without evidence because too many waited, since the start."""


class PlantModel(ApiModel):
    """Name of the plant and origin of the data."""

    name: str
    """Display name of the plant."""

    origin: Literal["live", "replay"]
    """"live" or "replay" of a recording; every answer repeats it in the header Padwatch-Origin."""


class StoreModel(ApiModel):
    """State of the database."""

    error: str | None
    """Reason why results cannot be stored or read; null without a fault."""

    n_unstored: int
    """Number of results that are not in the database, because it did not answer for too long or
    rejected them."""


class CapturesModel(ApiModel):
    """State of the recordings around alarms."""

    error: str | None
    """Reason why the newest recording failed; null if it succeeded."""

    n_running: int
    """Number of recordings in progress."""

    n_written: int
    """Number of recordings finished since the service started."""


class UnitOverviewModel(BasicUnitModel):
    """Generating unit with the newest results and film summaries of all its guide bearings."""

    bearings: list[LatestModel]
    """Newest results of the guide bearings."""

    films: list[FilmBriefModel]
    """Summaries of the films of the guide bearings, in the order of `bearings`."""


class OverviewModel(DatedAnswer):
    """Overview of the plant: units, alarms, and state of the service."""

    plant: PlantModel
    """Name of the plant and origin of the data."""

    refresh_s: float
    """Time between successive results, s."""

    store: StoreModel
    """State of the database."""

    alarms: AlarmCountModel
    """Counts of alarms by state."""

    captures: CapturesModel
    """State of the recordings around alarms."""

    evidence: EvidenceStatusModel | None
    """State of the evidence of alarms; null if no evidence is kept."""

    units: list[UnitOverviewModel]
    """All units of the plant."""


DATA_AGE, AGE, NONE = b'"data_age_s":', b'"age_s":', b"null"

NO_UNITS = b'"units":[]}'

COUNTERS_S = 1.0
"""Maximum age of the sample counts in the overview, s, if nothing else changes."""

SHARED_S = 0.2
"""Time for which one answer serves all clients unless a link, result or alarm changes, s."""


@dataclass(frozen=True)
class Answer:
    """Rendered overview, with the state and monotonic time of rendering and its entity tag.

    Parameters
    ----------
    revision
        Values that make the answer outdated if any of them changes.
    made_s
        Monotonic time of rendering, s.
    """

    revision: tuple[object, ...]
    made_s: float
    tag: str
    body: bytes


@dataclass(frozen=True)
class UnitState:
    """State of a unit, from which the part of the overview about this unit is rendered.

    Parameters
    ----------
    values
        Objects of the state; a change replaces an object and does not modify it.
    status
        Status of the unit, which is replaced when samples arrive.
    ages_s
        Age of the newest sample, then age of the newest result of each bearing, s; None if unknown.
    now_s
        Monotonic time of the state, s.
    """

    values: Sequence[object]
    status: UnitStatus
    ages_s: Sequence[float | None]
    now_s: float


@dataclass(frozen=True)
class UnitPart:
    """Rendered JSON of a unit without its ages.

    Parameters
    ----------
    state
        State that was rendered.
    pieces
        JSON before, between and after the ages.
    digest
        Hash of the JSON without ages.
    """

    state: UnitState
    pieces: Sequence[bytes]
    digest: bytes

    def is_of(self, state: UnitState) -> bool:
        """Whether the JSON is up to date with a state; objects are compared by identity."""
        mine = self.state
        if any(old is not new for old, new in zip(mine.values, state.values, strict=True)):
            return False
        return mine.status is state.status or state.now_s - mine.now_s < COUNTERS_S

    def filled(self, ages_s: Sequence[float | None]) -> bytes:
        """Return the JSON of the unit with the given ages, in the order of `UnitState.ages_s`."""
        first, *others = self.pieces
        ages = (NONE if age_s is None else repr(age_s).encode() for age_s in ages_s)
        return b"".join([first, *(x for pair in zip(ages, others, strict=True) for x in pair)])


class Overview:
    """Renderer of the overview; the JSON of each unit is cached until its state changes.

    The state is read on the event loop, on which it also changes; rendering runs in threads.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._parts: dict[str, UnitPart] = {}
        self._latest: dict[tuple[str, str], tuple[Sequence[object], LatestModel]] = {}
        self._rendering = Lock()
        self._answer: Answer | None = None

    async def answer(self) -> Response:
        """Return a response with the overview; render the overview first if it is outdated."""
        revision, now_s = self._revision(), self._context.clock.monotonic_s()
        kept = self._answer
        if kept is None or kept.revision != revision or now_s - kept.made_s >= SHARED_S:
            kept = self._answer = await self._make(revision, now_s)
        return Response(kept.body, media_type="application/json", headers={"ETag": kept.tag})

    def _revision(self) -> tuple[object, ...]:
        """Return values that make a rendered overview outdated if any of them changes."""
        live, alarms, captures = self._context.live, self._context.alarms, self._context.captures
        stored = (live.store_error, live.n_unstored)
        return (live.revision, alarms.revision, *stored, captures.error, captures.n_running)

    async def _make(self, revision: tuple[object, ...], now_s: float) -> Answer:
        states = {unit: self._state(unit) for unit in self._context.units}
        head = self._head()
        if any(self._is_old(unit, state) for unit, state in states.items()):
            await in_thread(lambda: self._renew(states))
        parts = [self._parts[unit] for unit in states]
        without_time = head.model_copy(update={"time": ""}).model_dump_json().encode()
        tag = tag_of(digest_of(without_time), *(part.digest for part in parts))
        units = [p.filled(s.ages_s) for p, s in zip(parts, states.values(), strict=True)]
        body = head.model_dump_json().encode().removesuffix(NO_UNITS)
        return Answer(revision, now_s, tag, body + b'"units":[' + b",".join(units) + b"]}")

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
        with self._rendering:  # concurrent requests do not render a part twice
            for unit, state in states.items():
                if self._is_old(unit, state):
                    self._parts[unit] = self._part(unit, state)

    def _part(self, unit: str, state: UnitState) -> UnitPart:
        context, settings = self._context, self._context.units[unit]
        source = source_model(context.live, unit).model_copy(update={"data_age_s": None})
        model = UnitOverviewModel.of(
            settings,
            source=source,
            bearings=[self._ageless(unit, bearing.id) for bearing in settings.bearing],
            films=[film_brief(context, unit, bearing.id) for bearing in settings.bearing],
        )
        content = model.model_dump_json().encode()
        return UnitPart(state, _around_ages(content), digest_of(content))

    def _ageless(self, unit: str, bearing: str) -> LatestModel:
        """Return the newest result of a bearing without its age, cached until the next result."""
        current = self._context.live.current(unit, bearing)
        values = (current.assessment, current.quality.reason)
        kept = self._latest.get((unit, bearing))
        if kept is None or any(new is not old for new, old in zip(values, kept[0], strict=True)):
            latest = latest_model(self._context.live, unit, bearing)
            kept = (values, latest.model_copy(update={"age_s": None}))
            self._latest[unit, bearing] = kept
        return kept[1]

    def _head(self) -> OverviewModel:
        """Return the API model of the overview, with an empty list of units."""
        context = self._context
        return OverviewModel.of(
            context,
            plant=PlantModel.of(context, name=context.plant_name),
            time=context.clock.now_ns(),
            store=StoreModel.of(context.live, error=context.live.store_error),
            alarms=context.alarms.count(),
            evidence=context.evidence and context.evidence(),
            units=[],
        )


def _around_ages(content: bytes) -> list[bytes]:
    """Split the JSON of a unit at its null ages: of the newest sample, then of each result."""
    source, bearings = content.split(DATA_AGE + NONE, 1)
    *before, last = bearings.split(AGE + NONE)
    return [source + DATA_AGE, *(piece + AGE for piece in before), last]


def overview_router(context: Context) -> APIRouter:
    """Return the router for the overview."""
    router = subject_router("", "plant")
    shown = Overview(context)

    @router.get("/overview", summary="Overview", response_model=OverviewModel)
    async def overview() -> Response:
        """Return all units with bearings and films; values that are not current are null."""
        return await shown.answer()

    return router
