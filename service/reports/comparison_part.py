"""What a film was compared with: baseline, cell, its members, the map around it."""

from typing import Annotated, Literal

from pydantic import Field

from service.reports.bearing_part import Direction
from service.reports.part import EvidencePart, Moment, Numbers


class BaselinePart(EvidencePart):
    """Which baseline."""

    version: int
    """Counts the baselines of the bearing."""

    author: Annotated[str, Field(examples=["padwatch"])]
    """Who had it learned."""

    created: Moment
    """When."""

    event: str
    """What happened to the machine that made it necessary; may be empty."""

    learned_from: Moment
    """First reading it knows."""

    learned_until: Moment
    """Last reading it knows."""

    scatter: float
    """Of single readings about what is expected, over all cells, in ln."""


class CellPart(EvidencePart):
    """One cell of the baseline."""

    cell: list[int]
    """Bins of eccentricity, oil temperature and, where it counts, attitude."""

    n_readings: int
    """Readings in it."""

    n_days: int
    """Days with readings."""

    location_n_per_m: float
    """Median of its readings."""

    scatter: float
    """Of its readings, in ln."""

    surface_std: float
    """Standard uncertainty of what is expected, in ln."""

    support: Literal["none", "borrowed", "own"]
    """Whether readings in it can be judged."""


class TimeScalePart(EvidencePart):
    """The mean deviation over one time scale."""

    time_scale_h: float
    """Running hours."""

    change: float
    """Mean deviation, in ln."""

    std: float
    """What a healthy film's would stray by."""

    sure_from: float
    """Standard uncertainties from which on it is sure."""


class MembersPart(EvidencePart):
    """Readings of the cell that the baseline stands on, by column."""

    n_in_all: int
    """How many there are; those that follow are spread evenly over them."""

    time: Numbers
    """Seconds since 1970 UTC."""

    stiffness_n_per_m: Numbers
    """Stiffness."""

    u_random: Numbers
    """Random standard uncertainty of its logarithm."""

    eccentricity_ratio: Numbers
    """Eccentricity ratio."""

    oil_temperature_c: Numbers
    """Oil temperature, °C."""


class ExpectedPart(EvidencePart):
    """What is expected along the eccentricity at the oil temperature of the reading, by column."""

    eccentricity_ratio: Numbers
    """Eccentricity ratio."""

    stiffness_n_per_m: Numbers
    """Expected stiffness; null where nothing is known."""


class ComparisonPart(EvidencePart):
    """A film in one direction, and what it was compared with."""

    bearing: Annotated[str, Field(examples=["UJB"])]
    """Bearing."""

    direction: Direction
    """Direction."""

    estimator: Annotated[str, Field(examples=["dynamic"])]
    """Whose stiffness."""

    time: Moment
    """Of the reading."""

    stiffness_n_per_m: float | None
    """What was measured."""

    u_random: float | None
    """Random standard uncertainty of its logarithm."""

    eccentricity_ratio: float | None
    """Under which eccentricity ratio."""

    oil_temperature_c: float | None
    """Under which oil temperature, °C."""

    attitude_deg: float | None
    """Attitude angle."""

    expected_n_per_m: float | None
    """What the baseline expects there; null if it knows nothing of it."""

    baseline: BaselinePart | None
    """Null if there was none."""

    cell: CellPart | None
    """Null if the baseline has not seen it."""

    bounds: list[tuple[float, float]] | None
    """Limits of the cell in eccentricity, oil temperature and, where it counts, attitude."""

    time_scales: list[TimeScalePart]
    """Mean deviations over all time scales."""

    members: MembersPart | None
    """Null if they could not be read, or there is no cell."""

    expected: ExpectedPart | None
    """Null without a baseline."""

    map: list[CellPart]
    """All cells of the baseline."""
