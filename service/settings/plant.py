"""The plant file as a whole: plant, service, analysis and spectra."""

import math
from typing import Annotated, Self

from pydantic import Field, StringConstraints, model_validator

from core.units import hz_from_rpm
from service.settings.alarms import AlarmSettings, CaptureSettings
from service.settings.base import MisfitError, Settings, refuse_twice, refuse_unknown_units
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
    """Number of spectra kept of each bearing: the newest ones densely, older ones sparsely.

    A spectrum up to 25 Hz at the default settings takes 4 kB of disk.
    """

    dense_every_s: EveryS = 60.0
    """Interval of the dense spectra, s."""

    n_dense: Count = 1440
    """Number of dense spectra kept of each bearing; 1440 are a day."""

    sparse_every_s: EveryS = 600.0
    """Interval of the sparse spectra, s; at least dense_every_s."""

    n_sparse: Count = 52_560
    """Number of sparse spectra kept of each bearing; 52560 are a year and take 0.2 GB."""

    n_lines: Annotated[int, Field(ge=8, le=20_000)] = 1000
    """Maximum number of lines kept of a spectrum, from the lowest frequency."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.sparse_every_s < self.dense_every_s:
            limit = f"must not be below dense_every_s, {self.dense_every_s:g}"
            raise MisfitError(limit, "sparse_every_s")
        return self


MIN_SEGMENT_TURNS = 8
"""A Hann taper spreads a line over two bins to each side; the vortex at a quarter of the running
speed must lie outside that range around zero."""

MIN_SPECTRUM_ORDERS = 2
"""The spectrum must include the 1× line with its surroundings."""


class PlantSettings(Settings):
    """Name of the plant."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=80)]
    """Shown on every page; example: "Itaipu"."""


class ServiceSettings(Settings):
    """The running program."""

    host: Annotated[str, StringConstraints(min_length=1)] = "127.0.0.1"
    """Address of the HTTP server. An address other than loopback requires [service.tls] and an
    account (padwatch users add)."""

    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    """TCP port of the HTTP server; 0 takes a free one and prints it."""

    socket: Annotated[str, StringConstraints(pattern=r"^/[^\x00]{1,99}$")] | None = None
    """Unix socket to listen on instead of host and port, for a proxy on this computer; example:
    "/run/padwatch/http.sock". Only there padwatch trusts the client addresses that the proxy
    adds."""

    tls: TlsSettings | None = None
    """Certificate of the HTTP server; without it HTTP is unencrypted."""

    data_folder: Annotated[str, StringConstraints(min_length=1)] = "var"
    """Folder of the database, relative to the working directory."""

    hosts: Annotated[tuple[HostName, ...], Field(max_length=32)] = ()
    """Host names that requests may have besides loopback, the configured address and the host of
    dashboard_url; needed behind a proxy that forwards the name; example:
    ["padwatch.plant.example"]."""

    limits: HttpLimitSettings = HttpLimitSettings()
    """Limits of the requests of one client."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.socket is not None:
            if self.tls is not None:
                raise MisfitError(
                    "applies to a host and port; on a socket the proxy has TLS", "tls"
                )
        elif not is_loopback(self.host) and self.tls is None:
            raise MisfitError(
                "is reachable from other hosts, which requires a certificate and its key in"
                " [service.tls]; else use 127.0.0.1, or a unix socket behind a proxy",
                "host",
            )
        return self


class DynamicModel(Settings):
    """Estimation of all eight film coefficients between the harmonics of the running speed."""

    band_hz: tuple[float, float] = (0.6, 12.0)
    """Frequency band of the lines [low, high], Hz."""

    guard_bins: Annotated[float, Field(ge=1.0, le=50.0)] = 3.0
    """Distance from each harmonic, in bins, within which lines are excluded because of runout."""

    probe_noise_um2_per_hz: Annotated[float, Field(ge=0.0, le=1e3)] | None = None
    """Known one-sided noise density of the shaft probes, µm²/Hz; estimated in the quiet band by
    default; example: 0.0048, which is white noise of 1.2 µm rms up to 300 Hz."""

    quiet_band_hz: tuple[float, float] = (15.0, 25.0)
    """Band [low, high] in Hz without shaft motion, in which the noise of the probes is measured."""

    max_relative_uncertainty: Annotated[float, Field(gt=0.0, le=1.0)] = 0.2
    """Maximum random standard uncertainty of a direct stiffness, as a share; otherwise there is no
    result."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("band_hz", "quiet_band_hz"):
            low, high = getattr(self, name)
            if not 0.0 < low < high:
                raise MisfitError(f"must increase from above 0, got [{low:g}, {high:g}]", name)
        return self


class AnalysisModel(Settings):
    """Segments and averaging; the defaults are those of Brito et al., section 3.1."""

    segment_samples: Annotated[int, Field(ge=256, le=1_048_576)] = 8192
    """Points of one Hann-tapered segment."""

    overlap: Annotated[float, Field(ge=0.0, le=0.9)] = 0.125
    """Overlap of consecutive segments, as a share, 0 to 0.9."""

    n_segments: Annotated[int, Field(ge=1, le=1000)] = 24
    """Number of averaged segments; 24 of 8192 points at 600 Hz are about five minutes."""

    max_frequency_hz: Annotated[float, Field(gt=0.0, le=10_000.0)] = 25.0
    """Spectra are kept up to this frequency."""

    vortex_order: Annotated[float, Field(ge=0.05, le=0.9)] = 0.25
    """Nominal frequency of the part-load vortex in multiples of the running speed."""

    vortex_band: tuple[float, float] = (0.2, 0.4)
    """Range of orders in which the vortex peak is searched."""

    min_segments: Annotated[int, Field(ge=2, le=1000)] = 4
    """Number of segments below which a result is uncertain."""

    min_coherence: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.9
    """Squared coherence of shaft and bearing motion below which no stiffness is given."""

    min_line_to_floor: Annotated[float, Field(ge=1.0, le=1e6)] = 10.0
    """Ratio of the power of a line to its surroundings that counts as excitation while there are
    too few segments for a coherence."""

    min_coverage: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    """Share of the possible segments below which a result is uncertain."""

    dynamic: DynamicModel = DynamicModel()
    """Estimation of all eight film coefficients."""

    min_speed_fraction: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.2
    """Share of the rated speed below which the machine counts as stopped."""

    speed_tolerance: Annotated[float, Field(ge=0.0005, le=0.05)] = 0.002
    """Difference of the measured speed and the 1× line, as a share, above which results are
    uncertain (speed_implausible), since an amplitude beside its line is too low. Raise it for a
    coarser speed channel; example: 0.005 for one in whole r/min at 200 r/min."""

    max_power_change: Annotated[float, Field(gt=0.0, le=1.0)] = 0.05
    """Change of power within the averaging time, as a share of rated_power_mw or else of the
    present power, above which results are uncertain (non_stationary); example: 0.05, 35 MW of
    700."""

    velocity_low_order: Annotated[float, Field(ge=0.05, le=20.0)] = 0.25
    """Lower limit of the broad-band velocity of bearings, as a multiple of the rated speed."""

    velocity_high_hz: Annotated[float, Field(gt=0.0, le=100_000.0)] = 1000.0
    """Upper limit of the broad-band velocity of bearings, if the sampling rate allows it."""

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
                f"must not be above n_segments {self.n_segments}, or all results are uncertain",
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
    """Logins of people and programs."""

    analysis: AnalysisModel = AnalysisModel()
    """Segments and averaging."""

    alarms: AlarmSettings = AlarmSettings()
    """Delays and limits of the alarms of all units."""

    films: FilmAlarmSettings = FilmAlarmSettings()
    """Monitoring of film stiffness against its baseline."""

    capture: CaptureSettings = CaptureSettings()
    """Captures of samples around alarms."""

    recording: RecordingSettings = RecordingSettings()
    """Continuous recording of all samples."""

    evidence: EvidenceSettings = EvidenceSettings()
    """Evidence of alarms beside their samples."""

    spectra: SpectraSettings = SpectraSettings()
    """History of spectra."""

    store: StoreSettings = StoreSettings()
    """Database of results."""

    space: SpaceSettings = SpaceSettings()
    """Free disk space below which an alarm is raised."""

    retention: RetentionSettings = RetentionSettings()
    """Retention of results by resolution."""

    stream: StreamSettings | None = None
    """Stream of blocks from `padwatch acquire` to `padwatch analyse`; not used by `padwatch
    run`."""

    delivery: DeliverySettings = DeliverySettings()
    """Receivers of notifications about alarms."""

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
        units = tuple(unit.id for unit in self.unit)
        refuse_unknown_units(self.recording.units, units, "recording", "units")
        for n, receiver in enumerate(self.delivery.receiver):
            refuse_unknown_units(receiver.units or (), units, "delivery", "receiver", n, "units")
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
                f" {n_needed} samples, to separate the vortex from 1×",
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
