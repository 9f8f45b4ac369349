"""Models that several subjects share: quality, reading, uncertainty, window, condition."""

import math
from collections.abc import Iterable
from enum import Enum
from types import SimpleNamespace
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from pydantic import (
    AfterValidator,
    AliasChoices,
    AliasGenerator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    StringConstraints,
    model_validator,
)

from core.arrays import FloatArray
from core.condition.cells import BearingCondition, Cell, CellGrid, FilmConditions, OperatingPoint
from core.condition.operating_state import OperatingState
from core.monitor.assessment import AveragingWindow
from core.monitor.catalogue import BY_NAME
from core.quality import Level, Reading
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y
from service.runtime.times import rfc3339


class ApiModel(BaseModel):
    """Model of an answer, without NaN or infinity; field docstrings are its documentation.

    A model can be made from the attributes of an object: a field takes the attribute of its name,
    or of its name with the suffix ``_ns`` for times.
    """

    model_config = ConfigDict(
        extra="forbid",
        allow_inf_nan=False,
        use_attribute_docstrings=True,
        from_attributes=True,
        populate_by_name=True,
        alias_generator=AliasGenerator(validation_alias=lambda n: AliasChoices(n, f"{n}_ns")),
    )

    @classmethod
    def of(cls, *sources: object, **values: object) -> Self:
        """Return a model of given values and, for the other fields, of attributes of objects."""
        return cls.model_validate(_Merged(SimpleNamespace(**values), *sources))


class _Merged:
    """Attributes of several objects; the first object with an attribute counts."""

    def __init__(self, *sources: object) -> None:
        self._sources = sources

    def __getattr__(self, name: str) -> Any:
        for source in self._sources:
            if (value := getattr(source, name, ...)) is not ...:
                return value
        raise AttributeError(name)


MAX_UNKNOWN = 8
"""Maximum number of unknown members reported one by one."""


class RequestModel(ApiModel):
    """Body of a request, without unknown members or type conversions."""

    model_config = ConfigDict(strict=True, alias_generator=None, from_attributes=False)

    @model_validator(mode="before")
    @classmethod
    def _reject_many_members(cls, body: Any) -> Any:
        """Reject thousands of members at once; one error each would cost 10 µs each."""
        if isinstance(body, dict) and len(body) > len(cls.model_fields) + MAX_UNKNOWN:
            known = ", ".join(cls.model_fields)
            raise ValueError(f"{len(body)} members are too many; known: {known}")
        return body


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must be printable characters on one line")
    return text


ActorName = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=80),
    AfterValidator(_printable),
    Field(examples=["A. Name"]),
]

ReasonText = Annotated[
    str,
    StringConstraints(strip_whitespace=True, min_length=1, max_length=500),
    AfterValidator(_printable),
    Field(examples=["probe is being changed"]),
]

NoteText = Annotated[
    str,
    StringConstraints(strip_whitespace=True, max_length=500),
    AfterValidator(_printable),
    Field(examples=["seen, shift engineer informed"]),
]


class ActorModel(RequestModel):
    """Request with the name of the person acting."""

    actor: ActorName | None = None
    """Person acting, 1 to 80 printable characters; ignored if the request is authenticated."""


LevelName = Literal["good", "uncertain", "bad"]

EstimatorName = Literal[
    "dynamic", "transfer_order1", "transfer_vortex", "ratio_order1", "ratio_vortex"
]

SpeedSourceName = Literal["key_phase", "slow_channel", "line", "rated"]

RunoutName = Literal["applied", "no_vector", "other_probe", "not_slow_roll", "no_phase_reference"]


def _time(value: object) -> object:
    return rfc3339(value) if isinstance(value, int) else value


def _name(value: object) -> object:
    return value.name.lower() if isinstance(value, Enum) else value


Time = Annotated[str, BeforeValidator(_time), Field(examples=["2026-11-21T09:03:12.400Z"])]
"""Time, RFC 3339; given as text or in nanoseconds since 1970."""

ByName = BeforeValidator(_name)
"""Validator that replaces a member of an enumeration by its name in lower case."""


class DatedAnswer(ApiModel):
    """Answer with the present time, which its entity tag ignores."""

    time: Time
    """Present time."""


class BearingAnswer(ApiModel):
    """Answer about one bearing."""

    unit: str
    """Identifier of the unit."""

    bearing: str
    """Identifier of the bearing."""


class BearingHistory(BearingAnswer):
    """Answer about one bearing in a time range."""

    start: Time
    """Start of the requested range."""

    end: Time
    """End of the requested range."""


class SampleRange(ApiModel):
    """Consecutive samples of a unit."""

    epoch: int
    """Changes when the device restarts its count."""

    first_index: int
    """Index of the first sample."""

    rate_hz: float
    """Samples per second."""


class QualityModel(ApiModel):
    """Quality of a value."""

    level: Annotated[LevelName, ByName]
    """Worst level of everything it is derived from."""

    reason: Annotated[str, Field(examples=["insufficient_excitation"])]
    """Reason of the level; "ok" if it is good."""


class UncertaintyModel(ApiModel):
    """Standard uncertainties (GUM), in the unit of the value."""

    random: float | None
    """Random part."""

    systematic: float | None
    """Systematic part, from transducers and bracket."""

    low_95: float
    """Lower end of the 95 % coverage interval."""

    high_95: float
    """Upper end of that interval."""


class ReadingModel(ApiModel):
    """One quantity with its quality."""

    value: Annotated[float | None, Field(examples=[0.6914e9])]
    """Null if and only if the level is bad."""

    unit: Annotated[str, Field(examples=["N/m"])]
    """Unit, and detector where it is an amplitude."""

    label: Annotated[str, Field(examples=["Effective stiffness x, 1×"])]
    """Description in words."""

    level: LevelName
    """Quality level."""

    reason: Annotated[str, Field(examples=["ok"])]
    """Reason of the level."""

    uncertainty: UncertaintyModel | None
    """Uncertainty of stiffness and damping; null if unknown."""


class WindowModel(ApiModel):
    """Samples of a result."""

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
    """Share of the possible segments in the average."""

    duration_s: float
    """Time from the first to the last sample, s."""


OperatingStateName = Literal[
    "unknown", "standstill", "run_up", "speed_no_load", "part_load", "full_load", "run_down"
]


class CellModel(ApiModel):
    """Cell of operating conditions whose readings are comparable."""

    eccentricity_low: Annotated[float, Field(examples=[0.35])]
    """Lower bound of the eccentricity ratio."""

    eccentricity_high: Annotated[float, Field(examples=[0.4])]
    """Upper bound of the eccentricity ratio."""

    oil_temperature_low_c: Annotated[float, Field(examples=[45.0])]
    """Lower bound of the oil temperature, °C."""

    oil_temperature_high_c: Annotated[float, Field(examples=[47.5])]
    """Upper bound of the oil temperature, °C."""

    attitude_low_deg: float | None
    """Lower bound of the attitude angle; null where cells do not depend on it."""

    attitude_high_deg: float | None
    """Upper bound, likewise."""


class FilmConditionModel(ApiModel):
    """Operating condition of a bearing."""

    time: Time
    """Time."""

    operating_state: Annotated[OperatingStateName, ByName]
    """Operating state of the unit."""

    is_settled: bool
    """Whether the state has lasted long enough, after the warm-up, for films to be compared."""

    cell: CellModel | None
    """Cell; null if eccentricity or oil temperature is unknown."""


PlaceName = Literal["shaft_x", "shaft_y", "bearing_x", "bearing_y"]


LEVEL_NAMES: dict[Level, LevelName] = {
    Level.GOOD: "good",
    Level.UNCERTAIN: "uncertain",
    Level.BAD: "bad",
}


def level_names(levels: Iterable[Level | None]) -> list[LevelName | None]:
    """Return the names of levels."""
    return [None if level is None else LEVEL_NAMES[level] for level in levels]


PLACES: dict[PlaceName, int] = {
    "shaft_x": SHAFT_X,
    "shaft_y": SHAFT_Y,
    "bearing_x": BEARING_X,
    "bearing_y": BEARING_Y,
}


def reading_model(name: str, reading: Reading) -> ReadingModel:
    """Return a reading with unit and label from the catalogue."""
    quantity = BY_NAME[name]
    return ReadingModel(
        value=reading.value,
        unit=quantity.unit,
        label=quantity.label,
        level=LEVEL_NAMES[reading.quality.level],
        reason=reading.quality.reason.value,
        uncertainty=_uncertainty(reading),
    )


def _uncertainty(reading: Reading) -> UncertaintyModel | None:
    if reading.interval_95 is None:
        return None
    return UncertaintyModel(
        random=reading.u_random,
        systematic=reading.u_systematic,
        low_95=reading.interval_95[0],
        high_95=reading.interval_95[1],
    )


def window_model(window: AveragingWindow) -> WindowModel:
    """Return the samples of a result."""
    return WindowModel.of(window, last_index=window.stop_index - 1)


STATE_NAMES = {state: cast("OperatingStateName", state.name.lower()) for state in OperatingState}


def states_named(names: list[OperatingStateName] | None) -> tuple[OperatingState, ...]:
    """Return operating states by name; none selects all."""
    return tuple(OperatingState[name.upper()] for name in names or ())


def condition_model(
    time_ns: int, condition: BearingCondition, grid: CellGrid
) -> FilmConditionModel:
    """Return the operating condition of a bearing."""
    cell = None if condition.cell is None else cell_model(condition.cell, grid)
    return FilmConditionModel.of(
        condition, time=time_ns, operating_state=condition.state, cell=cell
    )


def cell_of(point: OperatingPoint, grid: CellGrid) -> CellModel | None:
    """Return the cell of a point; None if one of its axes is unknown."""
    axes = (point.eccentricity_ratio, point.oil_temperature_c, point.attitude_deg)
    here = FilmConditions.one(*(math.nan if value is None else value for value in axes))
    if not grid.is_known(here)[0]:
        return None
    return cell_model(tuple(grid.cells(here)[:, 0].tolist()), grid)


def cell_model(cell: Cell, grid: CellGrid) -> CellModel:
    """Return the bounds of a cell."""
    eccentricity, temperature, *attitude = cell
    low_e, high_e = bounds(eccentricity, grid.eccentricity_width)
    low_c, high_c = bounds(temperature, grid.temperature_width_c)
    width_deg = grid.attitude_width_deg
    low_deg, high_deg = bounds(attitude[0], width_deg) if attitude and width_deg else (None, None)
    return CellModel(
        eccentricity_low=low_e,
        eccentricity_high=high_e,
        oil_temperature_low_c=low_c,
        oil_temperature_high_c=high_c,
        attitude_low_deg=low_deg,
        attitude_high_deg=high_deg,
    )


def bounds(number: int, width: float) -> tuple[float, float]:
    """Return the bounds of a bin, rounded."""
    return round(number * width, 9), round((number + 1) * width, 9)


def listed(values: FloatArray) -> list[float | None]:
    """Return values with None in place of NaN."""
    return [None if np.isnan(value) else value for value in values.tolist()]
