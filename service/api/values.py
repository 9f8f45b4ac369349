"""API models used by several routes: quality, reading, uncertainty, window, condition."""

import math
from typing import Annotated, Literal, cast

import numpy as np
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, StringConstraints

from core.arrays import FloatArray
from core.condition.cells import BearingCondition, Cell, CellGrid, FilmConditions, OperatingPoint
from core.condition.operating_state import OperatingState
from core.monitor.assessment import AveragingWindow
from core.quality import Level, Reading
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y
from service.api.meanings import describe_fields
from service.runtime.models import ByName as ByName
from service.runtime.models import Time as Time
from service.runtime.models import TimeNs as TimeNs
from service.runtime.models import ValueModel


class ApiModel(ValueModel):
    """Base class of API models; `MEANINGS` explains the fields that have no docstring."""

    model_config = ConfigDict(json_schema_extra=describe_fields)


class RequestModel(ApiModel):
    """Base class of request bodies, which reject unknown members and convert no types."""

    model_config = ConfigDict(strict=True, alias_generator=None, from_attributes=False)


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must have only printable characters, on one line")
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
    Field(description="Reason, on one line.", examples=["probe is being changed"]),
]

NoteText = Annotated[
    str,
    StringConstraints(strip_whitespace=True, max_length=500),
    AfterValidator(_printable),
    Field(examples=["seen, shift engineer informed"]),
]


class ActorModel(RequestModel):
    """Base class of request bodies with the name of the acting person."""

    actor: ActorName | None = None
    """Name of the acting person, 1 to 80 printable characters; ignored with a login or key."""


class ReasonModel(ActorModel):
    """Request for an action, with its reason."""

    reason: ReasonText


NoteOrNone = Annotated[str | None, BeforeValidator(lambda text: text or None)]
"""Type of a stored note; an empty note is converted to None."""

LevelName = Literal["good", "uncertain", "bad"]


class BearingAnswer(ApiModel):
    """Base class of answers about one bearing."""

    unit: str
    bearing: str


class BearingHistory(BearingAnswer):
    """Base class of answers about one bearing in a time range."""

    start: Time
    """Start of the requested range."""

    end: Time
    """End of the requested range."""


class SampleRange(ApiModel):
    """Base class of answers with consecutive samples of a unit."""

    epoch: int
    first_index: int
    rate_hz: float


class QualityModel(ApiModel):
    """Data quality of a value."""

    level: Annotated[LevelName, ByName]
    """Quality level of the value: the worst of all readings from which it is derived."""

    reason: Annotated[str, Field(examples=["insufficient_excitation"])]
    """Reason for the quality level; "ok" if the level is good."""


class UncertaintyModel(ApiModel):
    """Uncertainty of a value according to the GUM, in the unit of the value."""

    low_95: float
    high_95: float

    random: float | None
    """Random standard uncertainty; null if unknown."""

    systematic: float | None
    """Systematic standard uncertainty, due to transducers and bracket; null if unknown."""


class ReadingModel(QualityModel):
    """Reading of one quantity: value, data quality and uncertainty."""

    value: Annotated[float | None, Field(examples=[0.6914e9])]
    """Value of the reading, in the unit of the catalogue; null if and only if the level is bad."""

    uncertainty: UncertaintyModel | None
    """Uncertainty of a stiffness or damping; null for other quantities and if unknown."""


class WindowModel(ApiModel):
    """Averaging window of a result: range of samples and number of segments."""

    epoch: int
    first_index: int
    duration_s: float

    last_index: int
    """Index of the last sample."""

    n_segments: int
    """Number of averaged segments; all four channels are usable in every averaged segment."""

    n_segments_wanted: int
    """Number of segments of a full average."""

    n_voided: int
    """Number of segments discarded because of gaps in the samples since the service started."""

    coverage: float
    """Fraction of the segments in the window that are averaged, 0 to 1."""


OperatingStateName = Literal[
    "unknown", "standstill", "run_up", "speed_no_load", "part_load", "full_load", "run_down"
]


class CellModel(ApiModel):
    """Cell of the grid of operating conditions; film readings in one cell are comparable."""

    eccentricity_low: Annotated[float, Field(examples=[0.35])]
    eccentricity_high: Annotated[float, Field(examples=[0.4])]
    oil_temperature_low_c: Annotated[float, Field(examples=[45.0])]
    oil_temperature_high_c: Annotated[float, Field(examples=[47.5])]
    attitude_low_deg: float | None
    attitude_high_deg: float | None


class FilmConditionModel(ApiModel):
    """Operating condition of a bearing."""

    operating_state: Annotated[OperatingStateName, ByName]
    is_settled: bool
    cell: CellModel | None
    time: Time


PlaceName = Literal["shaft_x", "shaft_y", "bearing_x", "bearing_y"]


LEVEL_NAMES = {level: cast("LevelName", level.name.lower()) for level in Level}


PLACES: dict[PlaceName, int] = {
    "shaft_x": SHAFT_X,
    "shaft_y": SHAFT_Y,
    "bearing_x": BEARING_X,
    "bearing_y": BEARING_Y,
}


def reading_model(reading: Reading) -> ReadingModel:
    """Return the API model of a reading."""
    uncertainty = None
    if reading.interval_95 is not None:
        low, high = reading.interval_95
        random, systematic = reading.u_random, reading.u_systematic
        uncertainty = UncertaintyModel(
            random=random, systematic=systematic, low_95=low, high_95=high
        )
    return ReadingModel(
        value=reading.value,
        level=LEVEL_NAMES[reading.quality.level],
        reason=reading.quality.reason.value,
        uncertainty=uncertainty,
    )


def window_model(window: AveragingWindow) -> WindowModel:
    """Return the API model of an averaging window."""
    return WindowModel.of(window, last_index=window.stop_index - 1)


STATE_NAMES = {state: cast("OperatingStateName", state.name.lower()) for state in OperatingState}


def states_named(names: list[OperatingStateName] | None) -> tuple[OperatingState, ...]:
    """Return the operating states with the given names; without names, an empty tuple for all."""
    return tuple(OperatingState[name.upper()] for name in names or ())


def condition_model(
    time_ns: int, condition: BearingCondition, grid: CellGrid
) -> FilmConditionModel:
    """Return the API model of a bearing's operating condition at `time_ns`, ns since 1970 UTC."""
    cell = None if condition.cell is None else cell_model(condition.cell, grid)
    return FilmConditionModel.of(
        condition, time=time_ns, operating_state=condition.state, cell=cell
    )


def cell_of(point: OperatingPoint, grid: CellGrid) -> CellModel | None:
    """Return the API model of the cell of an operating point; None if a coordinate is unknown."""
    axes = (point.eccentricity_ratio, point.oil_temperature_c, point.attitude_deg)
    here = FilmConditions.one(*(math.nan if value is None else value for value in axes))
    if not grid.is_known(here)[0]:
        return None
    return cell_model(tuple(grid.cells(here)[:, 0].tolist()), grid)


def cell_model(cell: Cell, grid: CellGrid) -> CellModel:
    """Return the API model of a cell: its bounds in each quantity of the grid."""
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
    """Return the bounds of bin `number`, which begins at ``number * width``, to 9 decimals."""
    return round(number * width, 9), round((number + 1) * width, 9)


def listed(values: FloatArray) -> list[float | None]:
    """Return the values of an array as a list, with None in place of NaN."""
    return [None if np.isnan(value) else value for value in values.tolist()]
