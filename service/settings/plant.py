"""Model of the whole plant file, its loading, and its tables plant, service and analysis."""

import math
from pathlib import Path
from typing import Annotated, Any, Self

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
    SpectraSettings,
    StoreSettings,
)
from service.settings.toml_file import load_toml, schema_of
from service.settings.units import UnitSettings, require_lines_apart

MIN_SEGMENT_TURNS = 8
"""Minimum number of turns in a segment. The Hann taper spreads a line over two bins to each side;
the vortex at a quarter of the running speed must be more than two bins above zero frequency."""

MIN_SPECTRUM_ORDERS = 2
"""Minimum range of a spectrum in orders, so that it includes the 1× line and its neighbourhood."""


class PlantSettings(Settings):
    """Settings of the power plant as a whole."""

    name: Annotated[str, StringConstraints(min_length=1, max_length=80)]
    """Name of the plant, shown on every page of the dashboard; example: "Itaipu"."""


class ServiceSettings(Settings):
    """Settings of the running program: HTTP server and data folder."""

    host: Annotated[str, StringConstraints(min_length=1)] = "127.0.0.1"
    """IP address or host name of the HTTP server. An address other than loopback requires
    [service.tls] and an account (padwatch users add)."""

    port: Annotated[int, Field(ge=0, le=65535)] = 8080
    """TCP port of the HTTP server; with 0 a free port is used and printed."""

    socket: Annotated[str, StringConstraints(pattern=r"^/[^\x00]{1,99}$")] | None = None
    """Unix socket to listen on instead of host and port, for a proxy on this computer; example:
    "/run/padwatch/http.sock". Client addresses that a proxy adds are trusted only on this
    socket."""

    tls: TlsSettings | None = None
    """Certificate and key of the HTTP server; without this table HTTP is unencrypted."""

    data_folder: Annotated[str, StringConstraints(min_length=1)] = "var"
    """Folder of the database and other stored data, relative to the working directory."""

    hosts: Annotated[tuple[HostName, ...], Field(max_length=32)] = ()
    """Host names allowed in the Host header of requests, besides loopback, the configured host and
    the host of dashboard_url. Required behind a proxy that forwards the header; example:
    ["padwatch.plant.example"]."""

    limits: HttpLimitSettings = HttpLimitSettings()
    """Limits of HTTP requests and connections."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.socket is not None:
            if self.tls is not None:
                raise MisfitError(
                    "does not apply to a Unix socket; set up TLS in the reverse proxy", "tls"
                )
        elif not is_loopback(self.host) and self.tls is None:
            raise MisfitError(
                "is reachable from other hosts, which requires a certificate and its key in"
                " [service.tls]; else use 127.0.0.1, or a Unix socket behind a reverse proxy",
                "host",
            )
        return self


class DynamicModel(Settings):
    """Settings of the estimator `dynamic`, which fits four stiffnesses and four dampings of a film.

    They are fitted to the spectral lines between the harmonics of the running speed.
    """

    band_hz: tuple[float, float] = (0.6, 12.0)
    """Frequency band [low, high] of the spectral lines in the fit, Hz."""

    guard_bins: Annotated[float, Field(ge=1.0, le=50.0)] = 3.0
    """Distance from each harmonic of 1×, in spectral bins, within which lines are excluded because
    of runout."""

    probe_noise_um2_per_hz: Annotated[float, Field(ge=0.0, le=1e3)] | None = None
    """Known one-sided noise density of the shaft probes, µm²/Hz; by default the density is
    estimated in the quiet band. Example: 0.0048, which is white noise of 1.2 µm rms up to 300
    Hz."""

    quiet_band_hz: tuple[float, float] = (15.0, 25.0)
    """Frequency band [low, high] without shaft motion, in which the noise of the probes is
    estimated, Hz."""

    max_relative_uncertainty: Annotated[float, Field(gt=0.0, le=1.0)] = 0.2
    """Maximum relative standard uncertainty of a direct stiffness, random part; above
    this limit no stiffness is returned."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name in ("band_hz", "quiet_band_hz"):
            low, high = getattr(self, name)
            if not 0.0 < low < high:
                raise MisfitError("must be [low, high] with 0 < low < high", name)
        return self


class AnalysisModel(Settings):
    """Settings of signal segments and their averaging; defaults from Brito et al., section 3.1."""

    segment_samples: Annotated[int, Field(ge=256, le=1_048_576)] = 8192
    """Number of samples in one Hann-tapered segment."""

    overlap: Annotated[float, Field(ge=0.0, le=0.9)] = 0.125
    """Overlap of consecutive segments, as a fraction of a segment, 0 to 0.9."""

    n_segments: Annotated[int, Field(ge=1, le=1000)] = 24
    """Number of averaged segments; 24 segments of 8192 samples at 600 Hz take about five
    minutes."""

    max_frequency_hz: Annotated[float, Field(gt=0.0, le=10_000.0)] = 25.0
    """Maximum frequency of the spectra, Hz."""

    vortex_order: Annotated[float, Field(ge=0.05, le=0.9)] = 0.25
    """Nominal frequency of the part-load vortex in multiples of the running speed."""

    vortex_band: tuple[float, float] = (0.2, 0.4)
    """Range of orders [low, high] in which the vortex peak is searched."""

    min_segments: Annotated[int, Field(ge=2, le=1000)] = 4
    """Number of averaged segments below which a result is uncertain."""

    min_coherence: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.9
    """Squared coherence of shaft and bearing motion below which no stiffness is computed."""

    min_line_to_floor: Annotated[float, Field(ge=1.0, le=1e6)] = 10.0
    """Minimum ratio of the power of a spectral line to the median power of its neighbourhood for
    the line to count as excited while there are too few segments for a coherence."""

    min_coverage: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    """Fraction of the possible segments in the averaging window below which a result is
    uncertain."""

    dynamic: DynamicModel = DynamicModel()
    """Settings of the estimator of all eight film coefficients."""

    min_speed_fraction: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.2
    """Fraction of the rated speed below which the machine counts as stopped."""

    speed_tolerance: Annotated[float, Field(ge=0.0005, le=0.05)] = 0.002
    """Relative difference between the measured speed and the speed of the 1× line above which
    results are uncertain (speed_implausible), since an amplitude beside the line is too low.
    Increase the tolerance for a coarse speed channel; example: 0.005 for whole r/min at 200
    r/min."""

    max_power_change: Annotated[float, Field(gt=0.0, le=1.0)] = 0.05
    """Change of active power within the averaging time above which results are uncertain
    (non_stationary), as a fraction of rated_power_mw, or of the present power if rated_power_mw is
    not set; example: 0.05, which is 35 MW of 700."""

    velocity_low_order: Annotated[float, Field(ge=0.05, le=20.0)] = 0.25
    """Lower frequency limit of the broad-band velocity of bearings, as a multiple of the rated
    speed."""

    velocity_high_hz: Annotated[float, Field(gt=0.0, le=100_000.0)] = 1000.0
    """Upper frequency limit of the broad-band velocity of bearings, Hz; at most half the sampling
    rate."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        low, high = self.vortex_band
        if not 0.05 <= low < high <= 0.95:
            raise MisfitError("must be [low, high] with 0.05 <= low < high <= 0.95", "vortex_band")
        if not low < self.vortex_order < high:
            limits = f"must lie within vortex_band = [{low:g}, {high:g}]"
            raise MisfitError(limits, "vortex_order")
        if self.min_segments > self.n_segments:
            raise MisfitError(
                f"must not be above n_segments = {self.n_segments}, or all results are uncertain",
                "min_segments",
            )
        return self


class PlantFile(Settings):
    """Model of a plant file: plant, program, analysis and units."""

    plant: PlantSettings
    """Name of the plant."""

    service: ServiceSettings = ServiceSettings()
    """HTTP server and data folder of the running program."""

    access: AccessSettings = AccessSettings()
    """Whether logins are required, and how long they last."""

    analysis: AnalysisModel = AnalysisModel()
    """Segments, averaging and estimation."""

    alarms: AlarmSettings = AlarmSettings()
    """Common settings of all alarms: delays, chattering, and limits of the service."""

    films: FilmAlarmSettings = FilmAlarmSettings()
    """Monitoring of film stiffness against its baseline."""

    capture: CaptureSettings = CaptureSettings()
    """Captures of samples around alarms."""

    recording: RecordingSettings = RecordingSettings()
    """Continuous recording of all samples."""

    evidence: EvidenceSettings = EvidenceSettings()
    """Limits of the size, age and number of stored alarm evidence."""

    spectra: SpectraSettings = SpectraSettings()
    """Number and interval of stored spectra."""

    store: StoreSettings = StoreSettings()
    """Database of results."""

    space: SpaceSettings = SpaceSettings()
    """Free disk space below which an alarm is raised."""

    retention: RetentionSettings = RetentionSettings()
    """Retention of results and roll-ups."""

    stream: StreamSettings | None = None
    """Stream of sample blocks from `padwatch acquire` to `padwatch analyse`; not used by `padwatch
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
        low_hz = self.analysis.velocity_low_order * turn_hz
        high_hz = min(self.analysis.velocity_high_hz, high)
        if low_hz >= high_hz:
            raise MisfitError(
                f"for unit {unit.id} is {low_hz:g} Hz at rated speed; must be below {high_hz:g} Hz",
                *("analysis", "velocity_low_order"),
            )
        n_needed = math.ceil(MIN_SEGMENT_TURNS * unit.sampling_hz / turn_hz)
        if self.analysis.segment_samples < n_needed:
            raise MisfitError(
                f"for unit {unit.id} must be at least {n_needed} samples ({MIN_SEGMENT_TURNS} turns"
                " at rated speed) to separate the vortex from 1×",
                *("analysis", "segment_samples"),
            )


def plant_file_schema() -> dict[str, Any]:
    """Return the JSON schema of a plant file, with description, limits and default of every key."""
    return schema_of(PlantFile)


def load_plant_file(path: Path) -> PlantFile:
    """Read and validate a plant file, with its calibration sheets and register maps.

    Raises `TomlFileError` if the file is unreadable or invalid; the message lists every mistake.
    """
    return load_toml(path, PlantFile)
