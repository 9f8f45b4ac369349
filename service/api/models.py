"""What the API answers. Every number that may be missing is null with a level and a reason."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class ApiModel(BaseModel):
    """No NaN or infinity leaves the service; a field's docstring is its documentation."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


MAX_UNKNOWN = 8
"""Unknown members of a request that are named one by one."""


class RequestModel(ApiModel):
    """Body of a request: no unknown members, no conversions."""

    model_config = ConfigDict(strict=True)

    @model_validator(mode="before")
    @classmethod
    def _has_not_many_unknown_members(cls, body: Any) -> Any:
        """Refuse thousands of members at once: one error for each would cost 10 µs each."""
        if isinstance(body, dict) and len(body) > len(cls.model_fields) + MAX_UNKNOWN:
            known = ", ".join(cls.model_fields)
            raise ValueError(f"{len(body)} members are too many; known: {known}")
        return body


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

    clipped_share: Annotated[
        dict[str, float], Field(examples=[{"shaft_x": 0.0, "bearing_x": 0.0002}])
    ]
    """Share of the newest segment's samples that are at an end of the converter's range, by
    "shaft_x" to "bearing_y"; empty without waveforms, or if nothing is current."""

    window: WindowModel | None
    """The newest result's samples."""

    estimators: dict[str, EstimatorName | None]
    """Where `stiffness` came from, by axes "xx" and "yy"; null if there is none."""

    readings: dict[str, ReadingModel]
    """All quantities of the catalogue, by name."""
