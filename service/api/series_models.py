"""What the API answers about time and frequency: trends, gaps, spectra and orbits, by column."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.models import ApiModel, LevelName, Time

PlaceName = Literal["shaft_x", "shaft_y", "bearing_x", "bearing_y"]


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


class TrendGroupModel(ApiModel):
    """Trends of the readings under one condition, by column."""

    name: Annotated[str, Field(examples=["full_load"])]
    """Operating state, or bounds of the cell."""

    low: float | None
    """Eccentricity ratio or oil temperature in °C from which on; null for operating states."""

    high: float | None
    """Up to which, likewise."""

    bucket_s: float | None
    """Width of the buckets; null if each reading stands alone."""

    time: list[float]
    """Seconds since 1970 UTC: of each reading, or of the start of each bucket."""

    series: dict[str, TrendSeriesModel]
    """The quantities asked for."""


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

    simulated_until: Time | None
    """Until when readings are simulated, not measured on the machine; null where all in this range
    are measured."""

    coarse_until: Time | None
    """Up to when single readings were deleted, so that only buckets tell of that time and pages of
    single readings leave it out; null where all in this range are kept."""

    next_cursor: Annotated[str | None, Field(examples=["1795248192400000000"])]
    """With ``cursor``: what to give for the next page; null if this was the last."""

    groups: list[TrendGroupModel] | None
    """With ``group_by``, the same for each operating state or cell that has readings; readings
    whose condition is not known are in none."""


class GapModel(ApiModel):
    """Samples that nobody delivered, or that nobody was there to take."""

    epoch: int
    """Of the device's count."""

    first_index: int
    """Index of the first missing sample."""

    n_samples: int
    """How many are missing, per channel."""

    start: Time
    """Time of the first missing sample."""

    end: Time
    """Time of the first sample after the gap."""

    is_estimated: bool
    """Whether the device began to count anew in it: `n_samples` is worked out from the times then,
    and otherwise exact."""


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
