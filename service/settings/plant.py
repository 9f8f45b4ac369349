"""The plant file as a whole: plant, service, analysis and spectra."""

import math
from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from core.units import hz_from_rpm
from service.settings.alarms import AlarmSettings, CaptureSettings
from service.settings.base import MisfitError, Settings, refuse_twice
from service.settings.films import FilmAlarmSettings
from service.settings.notifications import DeliverySettings
from service.settings.processes import (
    AccessSettings,
    HostName,
    HttpLimitSettings,
    StreamSettings,
    TlsSettings,
    is_loopback,
)
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.storage import (
    EvidenceSettings,
    RecordingSettings,
    RetentionSettings,
    SpaceSettings,
    StoreSettings,
)
from service.settings.units import UnitSettings, require_lines_apart

EveryS = Annotated[float, Field(ge=1.0, le=86_400.0)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class SpectraSettings(Settings):
    """How many spectra of each bearing are kept; the newest ones densely, and older ones sparsely.

    A spectrum of 25 Hz at the standard settings takes 4 kB of disk with its surroundings.
    """

    dense_every_s: EveryS = 60.0
    """Time from one of the densely kept spectra to the next, s."""

    n_dense: Count = 1440
    """How many of these are kept of each bearing, the newest ones; 1440 are a day."""

    sparse_every_s: EveryS = 600.0
    """Time from one of the sparsely kept spectra to the next, s; at least dense_every_s."""

    n_sparse: Count = 52_560
    """How many of these are kept; 52560 are a year, and 0.2 GB for each bearing."""

    n_lines: Annotated[int, Field(ge=8, le=20_000)] = 1000
    """Most lines of a spectrum that are kept, from the lowest frequency on."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.sparse_every_s < self.dense_every_s:
            limit = f"must not be below dense_every_s, {self.dense_every_s:g}"
            raise MisfitError(limit, "sparse_every_s")
        return self


MIN_SEGMENT_TURNS = 8
"""A Hann taper spreads a line over two bins to each side; the vortex is a quarter turn away from
zero, and must lie outside that."""

MIN_SPECTRUM_ORDERS = 2
"""The spectrum must hold the 1× line with its surroundings."""


class PlantSettings(Settings):
    """Name of the plant."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=80)]
    """Shown on every page; example: "Itaipu"."""


class ServiceSettings(Settings):
    """The running program."""

    host: Annotated[str, StringConstraints(min_length=1)] = "127.0.0.1"
    """Address the HTTP server listens on. Any other than loopback needs [service.tls] and an
    account (padwatch users add)."""

    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    """TCP port of the HTTP server; 0 takes a free one and prints it."""

    socket: Annotated[str, StringConstraints(pattern=r"^/[^\x00]{1,99}$")] | None = None
    """File of a unix socket to listen on instead of host and port, for a proxy on this computer;
    example: "/run/padwatch/http.sock". What the proxy says of where a request comes from is
    believed there, and only there."""

    tls: TlsSettings | None = None
    """Certificate of the HTTP server; without it HTTP is plain."""

    data_folder: Annotated[str, StringConstraints(min_length=1)] = "var"
    """Folder of the database, relative to where padwatch is started."""

    hosts: Annotated[tuple[HostName, ...], Field(max_length=32)] = ()
    """Names that requests may ask for besides loopback's, the configured address and that of the
    dashboard in messages; needed behind a proxy that hands the name on; example:
    ["padwatch.plant.example"]."""

    limits: HttpLimitSettings = HttpLimitSettings()
    """Limits of the requests of one client."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.socket is not None:
            if self.tls is not None:
                raise MisfitError("is for a host and port: on a socket the proxy has TLS", "tls")
        elif not is_loopback(self.host) and self.tls is None:
            raise MisfitError(
                "is reached from other hosts, which needs a certificate and its key in"
                " [service.tls]; else use 127.0.0.1, or a unix socket behind a proxy",
                "host",
            )
        return self


class DynamicModel(Settings):
    """How all eight film coefficients are sought between the harmonics of the running speed."""

    band_hz: tuple[float, float] = (0.6, 12.0)
    """Lines are taken from this band [low, high] in Hz."""

    guard_bins: Annotated[float, Field(ge=1.0, le=50.0)] = 3.0
    """Distance from each harmonic, in bins, within which lines are left out: runout lives there."""

    probe_noise_um2_per_hz: Annotated[float, Field(ge=0.0, le=1e3)] | None = None
    """Known one-sided noise density of the shaft probes, µm²/Hz; without it the quiet band shows
    it; example: 0.0048, which is white noise of 1.2 µm rms up to 300 Hz."""

    quiet_band_hz: tuple[float, float] = (15.0, 25.0)
    """Band [low, high] in Hz in which the shaft hardly moves, for the probes' noise."""

    max_relative_uncertainty: Annotated[float, Field(gt=0.0, le=1.0)] = 0.2
    """Random standard uncertainty of a direct stiffness, as a share, beyond which there is no
    result."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("band_hz", "quiet_band_hz"):
            low, high = getattr(self, name)
            if not 0.0 < low < high:
                raise MisfitError(f"must rise from above 0, got [{low:g}, {high:g}]", name)
        return self


class AnalysisModel(Settings):
    """Segments and averaging; the defaults are those of Brito et al., section 3.1."""

    segment_samples: Annotated[int, Field(ge=256, le=1_048_576)] = 8192
    """Points of one Hann-tapered segment."""

    overlap: Annotated[float, Field(ge=0.0, le=0.9)] = 0.125
    """Share of a segment that the next one repeats, 0 to 0.9."""

    n_segments: Annotated[int, Field(ge=1, le=1000)] = 24
    """Segments that are averaged; 24 of 8192 points at 600 Hz are about five minutes."""

    max_frequency_hz: Annotated[float, Field(gt=0.0, le=10_000.0)] = 25.0
    """Spectra are kept up to this frequency."""

    vortex_order: Annotated[float, Field(ge=0.05, le=0.9)] = 0.25
    """Nominal frequency of the part-load vortex in multiples of the running speed."""

    vortex_band: tuple[float, float] = (0.2, 0.4)
    """Orders within which the vortex peak is looked for."""

    min_segments: Annotated[int, Field(ge=2, le=1000)] = 4
    """Fewer segments than this make a result uncertain."""

    min_coherence: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.9
    """Squared coherence of shaft and bearing motion below which no stiffness is given."""

    min_line_to_floor: Annotated[float, Field(ge=1.0, le=1e6)] = 10.0
    """Power of a line over its surroundings that counts as excitation before there are enough
    segments for a coherence."""

    min_coverage: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    """Share of the possible segments below which a result is uncertain."""

    dynamic: DynamicModel = DynamicModel()
    """How all eight film coefficients are sought."""

    min_speed_fraction: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.2
    """Share of the rated speed below which the machine counts as standing."""

    speed_tolerance: Annotated[float, Field(ge=0.0005, le=0.05)] = 0.002
    """Difference of the measured speed and the 1× line, as a share, beyond which results are
    uncertain (speed_implausible): beside its line an amplitude reads low. Raise it for a speed
    channel that is coarser; example: 0.005 for one in whole r/min at 200 r/min."""

    max_power_change: Annotated[float, Field(gt=0.0, le=1.0)] = 0.05
    """Change of power within the averaging time, as a share of rated_power_mw, beyond which results
    are uncertain (non_stationary); without rated_power_mw it is a share of the present power.
    Example: 0.05, 35 MW of 700."""

    velocity_low_order: Annotated[float, Field(ge=0.05, le=20.0)] = 0.25
    """Broad-band velocity of bearings counts from this multiple of the rated speed."""

    velocity_high_hz: Annotated[float, Field(gt=0.0, le=100_000.0)] = 1000.0
    """Broad-band velocity of bearings counts up to this frequency, as far as the sampling rate
    reaches."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        low, high = self.vortex_band
        if not 0.05 <= low < high <= 0.95:
            raise MisfitError("must be [low, high] within 0.05 to 0.95", "vortex_band")
        if not low < self.vortex_order < high:
            limits = f"must lie within vortex_band [{low:g}, {high:g}]"
            raise MisfitError(limits, "vortex_order")
        if self.min_segments > self.n_segments:
            raise MisfitError(
                f"must not be above n_segments {self.n_segments}, or no result is ever certain",
                "min_segments",
            )
        return self


class PlantFile(Settings):
    """A plant file: the plant, the program, the analysis and the units."""

    plant: PlantSettings
    """The plant."""

    service: ServiceSettings = ServiceSettings()
    """HTTP server and data folder of the running program."""

    access: AccessSettings = AccessSettings()
    """Logins: who needs one, and how long it lasts."""

    analysis: AnalysisModel = AnalysisModel()
    """Segments and averaging."""

    alarms: AlarmSettings = AlarmSettings()
    """Delays and limits of the alarms of all units."""

    films: FilmAlarmSettings = FilmAlarmSettings()
    """How films are compared with what they were like, and which changes are alarms."""

    capture: CaptureSettings = CaptureSettings()
    """Samples that are kept around an alarm."""

    recording: RecordingSettings = RecordingSettings()
    """All samples, kept for a while."""

    evidence: EvidenceSettings = EvidenceSettings()
    """What is kept of alarms beside their samples."""

    spectra: SpectraSettings = SpectraSettings()
    """Spectra that are kept over time."""

    store: StoreSettings = StoreSettings()
    """Database of results."""

    space: SpaceSettings = SpaceSettings()
    """How little room on the disk is an alarm."""

    retention: RetentionSettings = RetentionSettings()
    """For how long results are kept how finely."""

    stream: StreamSettings | None = None
    """Where `padwatch acquire` hands blocks to `padwatch analyse`; `padwatch run` needs none."""

    delivery: DeliverySettings = DeliverySettings()
    """Receivers of messages about alarms, besides the dashboard."""

    unit: Annotated[tuple[UnitSettings, ...], Field(min_length=1, max_length=200)]
    """Generating units."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_twice(("unit", n, "id", unit.id) for n, unit in enumerate(self.unit))
        require_lines_apart(
            (("unit", n, key), getattr(unit, key))
            for n, unit in enumerate(self.unit)
            for key in ("source", "slow_source")
        )
        self.delivery.require_units(tuple(unit.id for unit in self.unit))
        self.recording.require_units(tuple(unit.id for unit in self.unit))
        for unit in self.unit:
            if not isinstance(unit.source, ModbusVectorSettings):
                self._check_analysis(unit)
        return self

    def _check_analysis(self, unit: UnitSettings) -> None:
        turn_hz = hz_from_rpm(unit.rated_speed_rpm)
        low, high = MIN_SPECTRUM_ORDERS * turn_hz, unit.sampling_hz / 2
        if not low <= self.analysis.max_frequency_hz < high:
            raise MisfitError(
                f"for unit {unit.id} must be at least {MIN_SPECTRUM_ORDERS} times the rated speed,"
                f" {low:g} Hz, and below half the sampling rate, {high:g} Hz",
                *("analysis", "max_frequency_hz"),
            )
        self._check_velocity_band(unit)
        n_needed = math.ceil(MIN_SEGMENT_TURNS * unit.sampling_hz / turn_hz)
        if self.analysis.segment_samples < n_needed:
            raise MisfitError(
                f"for unit {unit.id} must hold {MIN_SEGMENT_TURNS} turns at rated speed,"
                f" {n_needed} samples, to tell the vortex from 1×",
                *("analysis", "segment_samples"),
            )

    def _check_velocity_band(self, unit: UnitSettings) -> None:
        low_hz = self.analysis.velocity_low_order * hz_from_rpm(unit.rated_speed_rpm)
        high_hz = min(self.analysis.velocity_high_hz, unit.sampling_hz / 2)
        if low_hz >= high_hz:
            raise MisfitError(
                f"for unit {unit.id} begins at {low_hz:g} Hz and must begin below {high_hz:g} Hz",
                *("analysis", "velocity_low_order"),
            )
