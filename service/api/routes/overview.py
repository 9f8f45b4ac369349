"""The overview of the plant, rendered once for all clients."""

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
    """State of the evidence of alarms."""

    error: str | None
    """Why the newest attempt to write evidence failed."""

    n_waiting: int
    """Occurrences whose evidence is not written yet."""

    n_written: int
    """Written since the service started."""

    n_lost: int
    """Dropped since then because too many were waiting."""


class PlantModel(ApiModel):
    """Name and origin."""

    name: str
    """Display name."""

    origin: Literal["live", "replay"]
    """Live data or replay of a recording; also in the header Padwatch-Origin of every answer."""


class StoreModel(ApiModel):
    """State of the database."""

    error: str | None
    """Why results are not stored; null if they are."""

    n_unstored: int
    """Results missing in the database: dropped because it did not answer for too long, or rejected
    by it and parked."""


class CapturesModel(ApiModel):
    """State of the recordings around alarms."""

    error: str | None
    """Why the newest recording failed; null if it did not."""

    n_running: int
    """Recordings in progress."""

    n_written: int
    """Recordings finished since the service started."""


class UnitOverviewModel(BasicUnitModel):
    """A unit with all its bearings."""

    bearings: list[LatestModel]
    """Its guide bearings now."""

    films: list[FilmBriefModel]
    """Summaries of their films, in the same order."""


class OverviewModel(DatedAnswer):
    """Overview of the plant for a control room."""

    plant: PlantModel
    """Name and origin."""

    refresh_s: float
    """Period of results, s."""

    store: StoreModel
    """State of the database."""

    alarms: AlarmCountModel
    """Numbers of alarms."""

    captures: CapturesModel
    """State of the recordings around alarms."""

    evidence: EvidenceStatusModel | None
    """State of the evidence of alarms; null where none is kept."""

    units: list[UnitOverviewModel]
    """All units."""


DATA_AGE, AGE, NONE = b'"data_age_s":', b'"age_s":', b"null"

NO_UNITS = b'"units":[]}'

COUNTERS_S = 1.0
"""Maximum age of sample counts, s; they change many times a second."""

SHARED_S = 0.2
"""Time for which one answer serves all clients if no link, result or alarm changes, s."""


@dataclass(frozen=True)
class Answer:
    """A rendered overview."""

    revision: tuple[object, ...]
    made_s: float
    tag: str
    body: bytes


@dataclass(frozen=True)
class UnitState:
    """State that the part of a unit is rendered from.

    Parameters
    ----------
    values
        Objects that are replaced when they change.
    status
        Object that is replaced when samples arrive.
    ages_s
        Ages of the newest sample and of the newest result of each bearing.
    now_s
        Monotonic time.
    """

    values: Sequence[object]
    status: UnitStatus
    ages_s: Sequence[float | None]
    now_s: float


@dataclass(frozen=True)
class UnitPart:
    """JSON of a unit, split where ages are inserted."""

    state: UnitState
    pieces: Sequence[bytes]
    digest: bytes

    def is_of(self, state: UnitState) -> bool:
        """Whether the state is unchanged; objects are compared by identity."""
        mine = self.state
        if any(old is not new for old, new in zip(mine.values, state.values, strict=True)):
            return False
        return mine.status is state.status or state.now_s - mine.now_s < COUNTERS_S

    def filled(self, ages_s: Sequence[float | None]) -> bytes:
        """Return the JSON with these ages."""
        first, *others = self.pieces
        ages = (NONE if age_s is None else repr(age_s).encode() for age_s in ages_s)
        return b"".join([first, *(x for pair in zip(ages, others, strict=True) for x in pair)])


class Overview:
    """Renders the overview; the part of a unit is kept until the unit changes.

    State is read on the event loop, which also writes it; threads render.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._parts: dict[str, UnitPart] = {}
        self._latest: dict[tuple[str, str], tuple[Sequence[object], LatestModel]] = {}
        self._rendering = Lock()
        self._answer: Answer | None = None

    async def answer(self) -> Response:
        """Return the overview."""
        revision, now_s = self._revision(), self._context.clock.monotonic_s()
        kept = self._answer
        if kept is None or kept.revision != revision or now_s - kept.made_s >= SHARED_S:
            kept = self._answer = await self._make(revision, now_s)
        return Response(kept.body, media_type="application/json", headers={"ETag": kept.tag})

    def _revision(self) -> tuple[object, ...]:
        """Return values whose change must be shown without delay."""
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
        with self._rendering:  # a concurrent request finds the parts rendered
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
        """Return a bearing without its age; it is rendered again after a new result."""
        current = self._context.live.current(unit, bearing)
        values = (current.assessment, current.quality.reason)
        kept = self._latest.get((unit, bearing))
        if kept is None or any(new is not old for new, old in zip(values, kept[0], strict=True)):
            latest = latest_model(self._context.live, unit, bearing)
            kept = (values, latest.model_copy(update={"age_s": None}))
            self._latest[unit, bearing] = kept
        return kept[1]

    def _head(self) -> OverviewModel:
        """Return the overview without units."""
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
    """Split the JSON of a unit at its ages, which are all null; the age of its source is first."""
    source, bearings = content.split(DATA_AGE + NONE, 1)
    *before, last = bearings.split(AGE + NONE)
    return [source + DATA_AGE, *(piece + AGE for piece in before), last]


def overview_router(context: Context) -> APIRouter:
    """Return the route of the overview."""
    router = subject_router("", "plant")
    shown = Overview(context)

    @router.get("/overview", summary="Everything at a glance", response_model=OverviewModel)
    async def overview() -> Response:
        """Show all units with all bearings; values that are not current are null."""
        return await shown.answer()

    return router
