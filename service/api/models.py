"""What the API answers. Every number that may be missing is null with a level and a reason."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class ApiModel(BaseModel):
    """No NaN or infinity leaves the service; a field's docstring is its documentation."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


LevelName = Literal["good", "uncertain", "bad"]

EstimatorName = Literal[
    "dynamic", "transfer_order1", "transfer_vortex", "ratio_order1", "ratio_vortex"
]

SpeedSourceName = Literal["key_phase", "slow_channel", "line", "rated"]

RunoutName = Literal["applied", "no_vector", "other_probe", "not_slow_roll", "no_phase_reference"]

Time = Annotated[str, Field(examples=["2026-11-21T09:03:12.400Z"])]


class QualityModel(ApiModel):
    """How far something may be believed."""

    level: LevelName
    """Worst of everything it is derived from."""

    reason: Annotated[str, Field(examples=["insufficient_excitation"])]
    """Why it is not good; "ok" if it is."""


class UncertaintyModel(ApiModel):
    """Standard uncertainties (GUM), in the unit of the value."""

    random: float | None
    """What differs from one result to the next."""

    systematic: float | None
    """What stays: transducers, bracket."""

    low_95: float
    """Lower end of the interval that holds the truth with 95 %."""

    high_95: float
    """Upper end of that interval."""


class ReadingModel(ApiModel):
    """One quantity with its quality."""

    value: Annotated[float | None, Field(examples=[0.6914e9])]
    """Null if and only if the level is bad."""

    unit: Annotated[str, Field(examples=["N/m"])]
    """Unit, and detector where it is an amplitude."""

    label: Annotated[str, Field(examples=["Effective stiffness x, 1×"])]
    """What it is, in words."""

    level: LevelName
    """How far the value may be believed."""

    reason: Annotated[str, Field(examples=["ok"])]
    """Why it is not good."""

    uncertainty: UncertaintyModel | None
    """Of stiffness and damping, where it is known."""


class WindowModel(ApiModel):
    """Which samples a result stands on."""

    epoch: int
    """Changes when the device restarts its count."""

    first_index: int
    """Index of the first sample."""

    last_index: int
    """Index of the last sample."""

    n_segments: int
    """Segments in the average in which all four channels were usable."""

    n_segments_wanted: int
    """Segments of a full average."""

    n_voided: int
    """Segments lost to gaps since the service started."""

    coverage: float
    """Share of the possible segments that are in the average."""

    duration_s: float
    """From the first to the last sample."""


class LatestModel(ApiModel):
    """A bearing now. Readings that are not current are null with the reason."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    time: Time | None
    """End of the newest result's samples, also if it is no longer current."""

    age_s: float | None
    """Seconds since that result was made."""

    quality: QualityModel
    """The worst of the 1× amplitudes and the preferred stiffness."""

    speed_source: SpeedSourceName | None
    """Where the running speed came from."""

    runout: Annotated[
        dict[str, RunoutName | None],
        Field(examples=[{"shaft_x": "applied", "shaft_y": "no_vector"}]),
    ]
    """Whether runout is taken off 1× of the newest segment, by "shaft_x" and "shaft_y": "applied",
    or why not: "no_vector" (none in the plant file), "other_probe" (it is of another probe than is
    there now), "not_slow_roll" (read above a quarter of the rated speed), "no_phase_reference" (no
    key-phase, or its pulses are missing, doubled, irregular or contradicted). Null if nothing is
    current."""

    window: WindowModel | None
    """The newest result's samples."""

    estimators: dict[str, EstimatorName | None]
    """Where `stiffness` came from, by axes "xx" and "yy"; null if there is none."""

    readings: dict[str, ReadingModel]
    """All quantities of the catalogue, by name."""


class SourceModel(ApiModel):
    """How the samples of a unit arrive, and where every one of them went."""

    state: Literal["connecting", "connected", "not_connected"]
    """Whether samples arrive."""

    reason: str | None
    """Why not."""

    since: Time | None
    """Since when it has been so."""

    data_age_s: float | None
    """Seconds since the newest sample arrived."""

    last_sample_time: Time | None
    """Time of that sample by the device's clock."""

    n_offered: int
    """Samples per channel the device counted: stored + flagged + gap + rejected."""

    n_stored: int
    """Taken, all channels good."""

    n_flagged: int
    """Taken, some channel not good."""

    n_gap: int
    """Never arrived."""

    n_repeated: int
    """Arrived again and were dropped."""

    n_restarts: int
    """How often the device began to count anew."""

    rejected: dict[str, int]
    """Arrived and were refused, by reason."""


class UnitModel(ApiModel):
    """A unit and how its samples arrive."""

    id: str
    """Stable identifier."""

    name: str
    """As people call it."""

    rated_speed_rpm: float
    """Rated running speed."""

    bearing_ids: list[str]
    """Its guide bearings."""

    source: SourceModel
    """How its samples arrive."""


class UnitOverviewModel(ApiModel):
    """A unit with all its bearings."""

    id: str
    """Stable identifier."""

    name: str
    """As people call it."""

    rated_speed_rpm: float
    """Rated running speed."""

    source: SourceModel
    """How its samples arrive."""

    bearings: list[LatestModel]
    """Its guide bearings now."""


class PlantModel(ApiModel):
    """The plant."""

    name: str
    """As people call it."""


class StoreModel(ApiModel):
    """Whether results reach the disk."""

    error: str | None
    """Why they do not."""

    n_unstored: int
    """Results given up because the store did not answer for too long."""


class OverviewModel(ApiModel):
    """Everything that a control room wants to see at a glance."""

    plant: PlantModel
    """The plant."""

    time: Time
    """Now."""

    refresh_s: float
    """Seconds from one result to the next."""

    store: StoreModel
    """Whether results reach the disk."""

    units: list[UnitOverviewModel]
    """All units."""


class QuantityModel(ApiModel):
    """A quantity that trends can be asked for."""

    name: str
    """As in readings and trends."""

    unit: str
    """Unit and detector."""

    label: str
    """What it is, in words."""


class TrendSeriesModel(ApiModel):
    """One quantity; a value for each time."""

    unit: str
    """Unit and detector."""

    min: list[float | None]
    """Lowest usable reading; null if there is none."""

    max: list[float | None]
    """Highest usable reading."""

    mean: list[float | None]
    """Mean of the usable readings."""

    count: list[int]
    """Number of usable readings."""

    worst_level: list[LevelName | None]
    """Worst quality in the bucket; null where there was no reading at all."""

    u_random: list[float | None] | None
    """Mean random standard uncertainty; null for quantities without."""

    u_systematic: list[float | None] | None
    """Mean systematic standard uncertainty; null for quantities without."""


class TrendModel(ApiModel):
    """Trends of one bearing, by column."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    start: Time
    """First time asked for."""

    end: Time
    """Time up to which was asked."""

    bucket_s: float | None
    """Width of the buckets; null if each reading stands alone."""

    time: list[float]
    """Seconds since 1970 UTC: of each reading, or of the start of each bucket."""

    series: dict[str, TrendSeriesModel]
    """The quantities asked for."""


class BudgetLineModel(ApiModel):
    """One contribution to the uncertainty of a result."""

    name: Annotated[str, Field(examples=["bracket stiffness"])]
    """What contributes."""

    kind: Literal["random", "systematic"]
    """Whether it differs from one result to the next, or stays."""

    distribution: Literal["normal", "uniform"]
    """What is known about it besides its width."""

    width: float
    """Standard uncertainty if normal, half-width if uniform, in the unit of what contributes."""

    sensitivity: float
    """Change of the result per unit of what contributes."""

    contribution: float
    """Standard uncertainty of the result by this alone."""


class BudgetModel(ApiModel):
    """Where the uncertainty of one result comes from (JCGM 100:2008, "GUM")."""

    quantity: Annotated[str, Field(examples=["dynamic_k_xx_n_per_m"])]
    """Name from the catalogue."""

    unit: Annotated[str, Field(examples=["N/m"])]
    """Unit of the value and of the uncertainties."""

    time: Time
    """End of the samples."""

    value: float
    """The result."""

    uncertainty: UncertaintyModel
    """All contributions together."""

    lines: list[BudgetLineModel]
    """Each contribution, largest first."""


class GapModel(ApiModel):
    """Samples that the device counted but nobody delivered."""

    epoch: int
    """Of the device's count."""

    first_index: int
    """Index of the first missing sample."""

    n_samples: int
    """How many are missing, per channel."""

    end: Time
    """Time of the first sample after the gap."""


class SpectrumChannelModel(ApiModel):
    """Amplitude spectrum of one channel."""

    unit: Literal["um_pk"]
    """Displacement, zero to peak."""

    amplitude: list[float] | None
    """A value for each frequency; null if the channel is not usable."""


class SpectrumModel(ApiModel):
    """Averaged amplitude spectra of a bearing, as displacement."""

    time: Time
    """End of the samples."""

    frequency_hz: list[float]
    """Frequencies of the lines."""

    channels: dict[str, SpectrumChannelModel]
    """shaft_x, shaft_y, bearing_x and bearing_y."""

    lines: dict[str, float | None]
    """Where order1 (1×) and the vortex were read."""


class OrbitModel(ApiModel):
    """The newest turns of the shaft relative to its bearing, means removed."""

    time: Time
    """Time of the first sample."""

    rate_hz: float
    """Samples per second."""

    duration_s: float
    """Length."""

    shaft_x_um: list[float]
    """Displacement in x."""

    shaft_y_um: list[float]
    """Displacement in y."""


class HealthModel(ApiModel):
    """Whether the service can do its work."""

    status: Literal["ok", "not ready"]
    """In a word."""

    checks: dict[str, str]
    """Each check in a sentence."""
