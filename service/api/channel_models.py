"""What the API answers about the channels of a unit, and their newest samples."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.models import ApiModel, QualityModel, Time

TransducerName = Literal[
    "proximity_probe", "displacement", "velocity", "accelerometer", "key_phase"
]

ChannelUnit = Annotated[
    Literal["um", "mm/s", "m/s2", "V"], Field(examples=["um"], description="Engineering unit.")
]


class WaveformChannelModel(ApiModel):
    """A waveform channel: its settings, and how it is now."""

    id: Annotated[str, Field(examples=["ujb_shaft_x"])]
    """Identifier within the unit."""

    transducer: TransducerName
    """What kind of transducer feeds it."""

    unit: ChannelUnit
    """Engineering unit of its samples."""

    sensitivity: float | None
    """As in the plant file; null for a key-phase, and where counts are scaled."""

    sensitivity_unit: str | None
    """Unit of the sensitivity."""

    full_scale_v: float | None
    """Converter input in volts that reads full scale; null where counts are scaled."""

    ok_min_v: float | None
    """Lowest mean voltage of a healthy transducer."""

    ok_max_v: float | None
    """Highest mean voltage of a healthy transducer."""

    unit_per_count: float | None
    """Engineering units per count, where counts are scaled; else null."""

    ok_min: float | None
    """Lowest mean of a healthy transducer whose counts are scaled, in engineering units."""

    ok_max: float | None
    """Highest mean of such a one."""

    gain_uncertainty: float
    """Half-width of what the sensitivity may be off, as a share."""

    direction: Literal[1, -1]
    """+1 if a growing reading is motion along the positive bearing axis, -1 if against it."""

    probe: str | None
    """Serial number or mark of the probe; null where it is not known."""

    used_by: Annotated[list[str], Field(examples=[["UJB shaft_x"]])]
    """What it is for: bearing and place, or "key_phase"."""

    quality: QualityModel
    """Of its newest block of samples."""

    minimum: float | None
    """Lowest sample of that block; null if the channel is bad, and from racks without samples."""

    maximum: float | None
    """Highest sample, likewise."""

    mean: float | None
    """Mean of the samples, likewise: of a proximity probe, the gap."""


class SlowChannelModel(ApiModel):
    """A slow channel: its settings and its newest reading."""

    id: Annotated[str, Field(examples=["ujb_oil_temperature"])]
    """Identifier within the unit."""

    unit: Literal["r/min", "MW", "degC", "mm"]
    """Unit of its readings."""

    minimum: float
    """Readings below are refused as out of range."""

    maximum: float
    """Readings above are refused as out of range."""

    used_by: Annotated[list[str], Field(examples=[["UJB oil_temperature"]])]
    """What it is for."""

    value: float | None
    """Newest reading; null if and only if the level is bad."""

    quality: QualityModel
    """Of that reading."""


class ChannelsModel(ApiModel):
    """All channels of a unit."""

    unit: str
    """Unit."""

    rate_hz: float
    """Samples per second and channel."""

    time: Time | None
    """End of the newest block, also if it is no longer current; null if there has been none."""

    age_s: float | None
    """Seconds since it arrived."""

    waveform: list[WaveformChannelModel]
    """Waveform channels in wire order."""

    slow: list[SlowChannelModel]
    """Slow channels in wire order."""


class ChannelSamplesModel(ApiModel):
    """Samples of one channel."""

    unit: ChannelUnit
    """Engineering unit."""

    quality: QualityModel
    """The worst of the blocks that the samples came in."""

    sample: list[float | None]
    """One for each index; null where it never arrived, or the channel was bad."""


class WaveformModel(ApiModel):
    """The newest samples of some channels of a unit, out of memory."""

    unit: str
    """Unit."""

    time: Time
    """Time of the first sample."""

    age_s: float
    """Seconds since the newest sample arrived: the link may have been lost since."""

    epoch: int
    """Changes when the device restarts its count."""

    first_index: int
    """Index of the first sample."""

    rate_hz: float
    """Samples per second."""

    n_samples: int
    """Of each channel."""

    channels: dict[str, ChannelSamplesModel]
    """The channels asked for."""
