"""API models used by several routes: quality, reading, uncertainty, window, condition."""

import math
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import AfterValidator, BeforeValidator, ConfigDict, Field, StringConstraints

from core.arrays import FloatArray
from core.condition.cells import BearingCondition, Cell, CellGrid, FilmConditions, OperatingPoint
from core.condition.operating_state import OperatingState
from core.monitor.assessment import AveragingWindow
from core.quality import Level, Reading
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y
from service.runtime.models import ByName as ByName
from service.runtime.models import Time as Time
from service.runtime.models import TimeNs as TimeNs
from service.runtime.models import ValueModel
from service.settings import base

MEANINGS = {
    # places and names
    "id": "Identifier.",
    "name": "Name for display; null without a name.",
    "unit": "Identifier of the unit.",
    "bearing": "Identifier of the bearing; null if a unit as a whole is meant.",
    "label": "Description of the quantity in words.",
    "estimator": "Estimator of the stiffness; null if the film is not watched.",
    "clearance_um": "Radial clearance in operation, µm.",
    # persons and their entries
    "time": "Time to which the entry refers.",
    "number": "Number of the entry in its history, from 1 without gaps.",
    "role": "Role, which determines the permissions.",
    "created": "Time of creation.",
    "actor": "Person, API key or program that acted; empty if unknown.",
    "author": "Person, API key or program that made the entry.",
    "set": "Time when the reference was set.",
    "note": "Note of the author; null without a note.",
    "reason": "Reason given by the person or program that acted; may be empty.",
    # operating condition
    "operating_state": "Operating state of the unit; null without current data.",
    "is_settled": "Whether the operating state, and with it the warm-up, has lasted long enough to"
    " judge films; null without a state.",
    "speed_rpm": "Running speed, r/min; null if unknown.",
    "power_mw": "Active power, MW; null if unknown.",
    "eccentricity_ratio": "Eccentricity ratio: eccentricity divided by clearance; null if unknown.",
    "attitude_deg": "Attitude angle, degrees; null if unknown.",
    "oil_temperature_c": "Oil temperature, °C; null if unknown.",
    "cell": "Cell of the grid of operating conditions; null if a coordinate of it is unknown.",
    "eccentricity_low": "Lower bound of the eccentricity ratio.",
    "eccentricity_high": "Upper bound of the eccentricity ratio.",
    "oil_temperature_low_c": "Lower bound of the oil temperature, °C.",
    "oil_temperature_high_c": "Upper bound of the oil temperature, °C.",
    "attitude_low_deg": "Lower bound of the attitude angle, degrees; null if cells do not depend"
    " on it.",
    "attitude_high_deg": "Upper bound of the attitude angle, degrees; null if cells do not depend"
    " on it.",
    # samples and spectra
    "epoch": "Epoch of the sample index; it changes when the device restarts its count.",
    "first_index": "Index of the first sample.",
    "n_samples": "Number of samples per channel.",
    "start": "Time of the first sample.",
    "duration_s": "Time from the first to the last of these samples, s.",
    "rate_hz": "Sampling rate, Hz.",
    "received": "Arrival time of the newest of these samples by the clock of the service, from"
    " which their age counts; null for recorded samples, and without samples.",
    "rejected": "Number of rejected samples, by reason.",
    "frequency_hz": "Frequencies of the spectral lines, Hz.",
    # alarms
    "occurrence": "Number of the occurrence of the alarm.",
    "change": "Kind of alarm event.",
    # films and baselines
    "x": "Values in the direction x; null if the film is not watched, or without a baseline.",
    "y": "Values in the direction y; null if the film is not watched, or without a baseline.",
    "baseline_version": "Version of the baseline in force; null if no baseline is in force.",
    "stiffness_n_per_m": "Film stiffness, N/m; null if it could not be determined, and without a"
    " known bracket stiffness.",
    "stiffness_of_kb": "Film stiffness as a ratio to the bracket stiffness; null if the latter is"
    " known.",
    "why_not": "Reason why the film is not watched; null if it is watched.",
    "limits": "Alarm limits of the stiffness; null if the film is not watched.",
    "change_percent": "Most significant mean change of the stiffness, % of the expected stiffness;"
    " null if unknown.",
    "deviation_percent": "Deviation of the reading alone, % of the expected stiffness; null if it"
    " was not compared.",
    "ck_s": "Damping over stiffness, s; null if it could not be determined.",
    "ck_level": "Alarm level of damping over stiffness in force; null without a level.",
    "ck_change_percent": "Most significant mean change of damping over stiffness, %; null if"
    " unknown.",
    # answers
    "origin": "Origin of the data: live, or replay of a recording.",
    "low_95": "Lower end of the 95 % coverage interval.",
    "high_95": "Upper end of the 95 % coverage interval.",
    "n_found": "Number of entries in the range, also of those that the answer omits.",
    "next_before": "Value of the parameter ``before`` for the next page; null on the last page.",
    "simulated_until": "End of the simulated readings; null if there are none in the range.",
}
"""Descriptions of fields in JSON schemas, by name of the field."""


def describe_fields(schema: dict[str, Any], model: type[Any]) -> None:
    """Add the docstrings of fields, and the meanings of those without, to a model's JSON schema."""
    base.describe_fields(schema, model)
    for name, field in schema.get("properties", {}).items():
        if "$ref" not in field and name in MEANINGS:
            field.setdefault("description", MEANINGS[name])


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


OperatingStateOf = Annotated[OperatingStateName, ByName, Field(validation_alias="state")]
"""Name of the attribute `state` of an operating condition."""


class FilmConditionModel(ApiModel):
    """Operating condition of a bearing."""

    operating_state: OperatingStateOf
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
    return FilmConditionModel.of(condition, time=time_ns, cell=cell)


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
