"""Routes for units, sources, gaps, notes, the configuration, and the catalogue of quantities."""

import asyncio
import json
from typing import Annotated, Any, Literal

from fastapi import Request, Response
from pydantic import Field

from core.monitor.catalogue import CATALOGUE, quantity_named
from core.samples.blocks import StampFault
from core.samples.gaps import Gap
from core.units import ns_from_s
from service.api.auth.gate import GuardedRouter, Reach, actor_or, needs, subject_router
from service.api.context import Context, UnitId
from service.api.downloads import file_content
from service.api.parameters import Moment, OptionalTimeRange, TimeRange, ns_from_datetime
from service.api.problems import ProblemError, problem_responses
from service.api.routes.alarms import COMMENT_LIMIT, Allowances
from service.api.values import ActorModel, ApiModel, ReasonText, Time
from service.live.current_state import LiveUnits
from service.live.snapshot import SourceCounts
from service.live.status import LinkState
from service.runtime.polls import PollStatistics
from service.settings.plant import plant_file_schema
from service.settings.units import UnitSettings
from service.store.access.identities import Permission
from service.store.notes import Note, notes_between


class DeviceClockModel(ApiModel):
    """Offset and drift of the device clock relative to the host clock."""

    offset_s: float | None
    """Offset of the device clock, s, positive if ahead; null if the device sends no time stamps."""

    drift_ppm: float | None
    """Deviation of the sampling rate, timed by the host clock, from its nominal value, ppm; null
    during the first minute, and for a device that samples on request."""

    drift_uncertainty_ppm: Annotated[float | None, Field(validation_alias="u_drift_ppm")]
    """Standard uncertainty of the drift, ppm; null if the drift is null."""

    n_stamp_faults: Annotated[int, Field(validation_alias="n_faults")]
    """Number of blocks whose time stamp was discarded because it contradicts the sample index."""

    stamp_fault: StampFault | None
    """Fault of the newest time stamp; null without a fault."""


class LinkModel(ApiModel):
    """State of the link to the data source of a unit."""

    state: LinkState
    """State of the link to the source; only the replay of a recording can be "ended"."""

    reason: str | None
    """Reason why samples do not arrive; null if they arrive."""

    since: Time | None
    """Start of the present state of the link; null if unknown."""


class SourceModel(LinkModel):
    """State of the data source of a unit, and counts of its samples."""

    received: Time | None
    rejected: dict[str, int]

    last_sample_time: Annotated[Time | None, Field(validation_alias="last_sample_ns")]
    """Time of the newest sample by the device clock; null without a sample."""

    n_offered: int
    """Number of samples per channel that the device made: stored + flagged + gap + rejected."""

    n_stored: int
    """Number of accepted samples with all channels good."""

    n_flagged: int
    """Number of accepted samples with at least one channel not good."""

    n_gap: int
    """Number of missing samples, which never arrived."""

    n_repeated: int
    """Number of samples received more than once; the repetitions were dropped."""

    n_restarts: int
    """Number of times the device restarted its sample index."""

    clock: DeviceClockModel | None
    """Offset and drift of the device clock; null if unknown."""


class SourceHealthModel(SourceModel):
    """Data source of a unit: kind, state, and counts of its samples."""

    unit: Annotated[str, Field(examples=["U1"])]
    rate_hz: float

    kind: Literal[
        "modbus_ring", "modbus_fifo", "modbus_polled", "modbus_vector", "can", "simulated"
    ]
    """Kind of source: protocol of the device, or simulation."""

    n_failed: int
    """Number of failed connection attempts and lost links since the service started."""

    poll_period_s: float | None
    """Poll period, s; null for a device that is not polled."""

    polls: PollStatistics | None
    """Statistics of polls; null before the second poll, and for a device that is not polled."""

    refused_frames: Annotated[dict[str, int], Field(examples=[{"duplicate": 2}])]
    """Number of CAN frames rejected since the service started, by reason."""


def source_model(live: LiveUnits, unit: str) -> SourceModel:
    """Return the API model of the data source of a unit: link, counts of samples, and clock."""
    status = live.status(unit)
    clock = status.clock and DeviceClockModel.of(status.clock, status)
    return SourceModel.of(status, status.account, clock=clock)


class GapModel(ApiModel):
    """Gap in the samples of a unit, also if the cause was a stop of the service."""

    epoch: int

    first_index: int
    """Index of the first missing sample."""

    n_samples: int
    """Number of missing samples per channel."""

    start: Time
    """Time of the first missing sample."""

    end: Time
    """Time of the first sample after the gap."""

    is_estimated: bool
    """Whether `n_samples` is estimated from times, because the device restarted its sample index in
    the gap; otherwise `n_samples` is exact."""


class BasicUnitModel(ApiModel):
    """Generating unit: identifier, name and rated speed."""

    id: str
    name: str

    rated_speed_rpm: float
    """Rated speed, r/min."""


class UnitModel(BasicUnitModel):
    """Generating unit with the state of its data source and its guide bearings."""

    source: SourceModel

    bearing_ids: list[str]
    """Identifiers of the guide bearings of the unit."""


class QuantityModel(ApiModel):
    """Measured quantity of a bearing, from the catalogue of quantities."""

    label: str

    name: str
    """Name of the quantity in readings and trends."""

    unit: str
    """Unit of the values; for an amplitude, also the detector."""


class ConfigurationModel(ApiModel):
    """Configuration of the service: settings of the plant file and defaults, without secrets."""

    version: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$", examples=["9f86d081" * 8])]
    """SHA-256 hash of the configuration; evidence reports of alarms state this version."""

    padwatch: Annotated[str, Field(examples=["0.1.0"])]
    """Version of the program."""

    commit: str | None
    """Source commit of the program; null if unknown."""

    settings: dict[str, Any]
    """All settings, structured like the plant file."""


class AddNoteModel(ActorModel):
    """Request to add a note."""

    bearing: Annotated[str | None, Field(examples=["UJB"])] = None

    text: ReasonText
    """Text, 1 to 500 printable characters."""

    time: Annotated[Moment, Field(strict=False, examples=["2026-11-21T08:00:00Z"])]
    """Time to which the note refers, RFC 3339 with offset."""


SCHEMA_TYPE = "application/schema+json"

SCHEMA_OF_SCHEMA = {"type": "object", "examples": [{"title": "PlantFile", "type": "object"}]}


def plant_router(context: Context) -> GuardedRouter:
    """Return the router for units, sources, gaps, notes, quantities and the configuration."""
    router, allowances = subject_router("", "plant"), Allowances()

    @router.get("/units")
    async def units() -> list[UnitModel]:
        """List all units with the state of their sources."""
        return [_unit(context, unit) for unit in context.units]

    @router.get("/units/{unit}")
    async def one_unit(unit: UnitId) -> UnitModel:
        """Return a unit with the state of its source."""
        return _unit(context, unit)

    @router.get("/quantities", dependencies=[needs(Permission.READ, Reach.NO_UNIT)])
    async def quantities() -> list[QuantityModel]:
        """List name, unit and description of all quantities of a bearing.

        The slow quantities that the plant file records come last.
        """
        recorded = (slow.recorded for unit in context.units.values() for slow in unit.slow_channel)
        names = dict.fromkeys(slow.reading for slow in recorded if slow is not None)
        others = filter(None, map(quantity_named, names))
        return [QuantityModel.of(quantity) for quantity in (*CATALOGUE, *others)]

    @router.get("/sources")
    async def sources() -> list[SourceHealthModel]:
        """List sources with link state, failed connections, counts of samples, and device clock."""
        return [_health(context, unit) for unit in context.units.values()]

    @router.get("/units/{unit}/gaps")
    async def gaps(unit: UnitId, times: TimeRange) -> list[GapModel]:
        """List gaps that end in the time range, oldest first, including stops of the service."""
        found = await asyncio.to_thread(context.store.gaps, unit, *times)
        rate_hz = context.units[unit].sampling_hz
        return [_gap_model(gap, rate_hz) for gap in found]

    @router.get("/units/{unit}/notes")
    async def notes(unit: UnitId, times: OptionalTimeRange) -> list[Note]:
        """List the notes about a unit and its bearings that refer to a time range.

        Of a unit, the 1000 notes that were added last are listed, the newest first.
        """
        return await asyncio.to_thread(notes_between, context.store.audit, unit, *times)

    @router.post(
        "/units/{unit}/notes",
        responses=COMMENT_LIMIT,
        dependencies=[needs(Permission.ACT_ON_ALARMS)],
    )
    async def add_note(request: Request, unit: UnitId, asked: AddNoteModel) -> Note:
        """Add a note; the audit trail records it, and it is never changed or deleted."""
        if asked.bearing is not None:
            context.bearing(unit, asked.bearing)
        time_ns = ns_from_datetime(asked.time, "time")
        allowances.take(request, context.clock.monotonic_s())
        note = Note(unit, asked.bearing, time_ns, asked.text, actor_or(asked.actor))
        await context.operators.add_note(note)
        return note

    @router.get(
        "/configuration",
        responses=problem_responses(own={404: "The service keeps no configuration"}),
    )
    async def configuration() -> ConfigurationModel:
        """Return the plant file as read when the service started, without secrets.

        Evidence reports of alarms state the version of the configuration.
        """
        if context.configuration is None:
            raise ProblemError(404, "No configuration", "this service has no configuration")
        document = json.loads(context.configuration.text)
        return ConfigurationModel.of(**document | {"version": context.configuration.version})

    @router.get(
        "/configuration/schema",
        dependencies=[needs(Permission.READ, Reach.NO_UNIT)],
        response_class=Response,
        responses=file_content(SCHEMA_TYPE, "A JSON schema", SCHEMA_OF_SCHEMA),
    )
    async def schema_of_plant_files() -> Response:
        """Return meaning, limits and default of every key of a plant file as a JSON schema."""
        return Response(json.dumps(plant_file_schema()), media_type=SCHEMA_TYPE)

    return router


def _unit(context: Context, unit: str) -> UnitModel:
    settings, source = context.units[unit], source_model(context.live, unit)
    return UnitModel.of(settings, source=source, bearing_ids=[b.id for b in settings.bearing])


def _health(context: Context, settings: UnitSettings) -> SourceHealthModel:
    return SourceHealthModel.of(
        source_model(context.live, settings.id),
        context.plant().sources.get(settings.id, SourceCounts()),
        context.live.status(settings.id),
        unit=settings.id,
        kind=settings.source.kind,
        rate_hz=settings.sampling_hz,
        poll_period_s=getattr(settings.source, "poll_period_s", None),
    )


def _gap_model(gap: Gap, rate_hz: float) -> GapModel:
    start_ns = gap.start_ns
    if start_ns is None:
        start_ns = gap.stop_ns - ns_from_s(gap.n_samples / rate_hz)
    return GapModel.of(gap, start=start_ns, end=gap.stop_ns)
