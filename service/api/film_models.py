"""What the API answers about a film now: verdict, change with its uncertainty, condition."""

from typing import Annotated, Literal

from pydantic import Field

from service.api.models import ApiModel, EstimatorName, Time

VerdictName = Literal[
    "normal",
    "alert",
    "danger",
    "gathering_evidence",
    "no_baseline",
    "insufficient_excitation",
    "bad_quality",
    "transient",
    "no_reading",
]

CauseName = Literal["film", "oil", "bracket_or_transducer", "unknown"]

OperatingStateName = Literal[
    "unknown", "standstill", "run_up", "speed_no_load", "part_load", "full_load", "run_down"
]

LevelHeldName = Literal["alert", "danger"]


class CellModel(ApiModel):
    """A cell of the grid within which like meets like: from the low bound up to the high one."""

    eccentricity_low: Annotated[float, Field(examples=[0.35])]
    """Eccentricity ratio from which on."""

    eccentricity_high: Annotated[float, Field(examples=[0.4])]
    """Eccentricity ratio up to which."""

    oil_temperature_low_c: Annotated[float, Field(examples=[45.0])]
    """Oil temperature from which on, °C."""

    oil_temperature_high_c: Annotated[float, Field(examples=[47.5])]
    """Oil temperature up to which, °C."""

    attitude_low_deg: float | None
    """Attitude angle from which on; null where the attitude does not part cells."""

    attitude_high_deg: float | None
    """Attitude angle up to which, likewise."""


class FilmConditionModel(ApiModel):
    """Under which condition a bearing runs."""

    time: Time
    """When."""

    operating_state: OperatingStateName
    """What the unit does."""

    is_settled: bool
    """Whether it has done so long enough, after the warm-up, for films to be compared."""

    cell: CellModel | None
    """Null where eccentricity or oil temperature is not known."""


class FilmChangeModel(ApiModel):
    """The most significant mean deviation of stiffness from the baseline."""

    percent: Annotated[float, Field(examples=[-19.2])]
    """Change of stiffness, %; negative is softer."""

    low_95: Annotated[float, Field(examples=[-21.9])]
    """Lower end of its 95 % interval, %."""

    high_95: Annotated[float, Field(examples=[-16.4])]
    """Upper end of that interval, %."""

    ln: Annotated[float, Field(examples=[-0.213])]
    """The same change as ln of stiffness over baseline, which is what limits are compared with."""

    ln_std: float
    """Its standard uncertainty."""

    time_scale_h: Annotated[float, Field(examples=[4.0])]
    """Running hours over which it was averaged."""

    significance: Annotated[float, Field(examples=[12.4])]
    """Standard uncertainties away from no change."""

    significance_wanted: Annotated[float, Field(examples=[6.5])]
    """From how many on a change over that time is sure."""

    as_of: Time | None
    """Newest reading that counted; null if it came before the service started, or before the
    baseline in force did."""


class FilmDeviationModel(ApiModel):
    """How far one reading is from its baseline."""

    percent: float
    """Deviation of stiffness, %."""

    low_95: float
    """Lower end of what a healthy film of that deviation may be, 95 %."""

    high_95: float
    """Upper end."""


class FilmCauseModel(ApiModel):
    """What a change is put down to, from how the shaft moves."""

    cause: CauseName
    """The film of this bearing, the oil of all of them, bracket or transducer, or unknown."""

    reason: str
    """In words."""

    film_share: float | None
    """Part of the change that is the film's if the rest is an accelerometer's, 0 to 1 but for its
    uncertainty; null if not known, or if the shaft moves as with no such mixture."""

    film_share_std: float | None
    """Its standard uncertainty."""


class FilmDirectionModel(ApiModel):
    """A film in one direction."""

    verdict: VerdictName
    """What the newest reading says. Only "normal", "alert" and "danger" judge the film; all others
    say why it is not judged: too little evidence yet ("gathering_evidence"), no baseline for this
    condition ("no_baseline"), too little motion ("insufficient_excitation"), a number that is
    doubted ("bad_quality"), a unit that has not settled ("transient"), or no current reading
    ("no_reading")."""

    reason: Annotated[str, Field(examples=["condition_not_learned"])]
    """Why it is not judged; "ok" if it is."""

    level: LevelHeldName | None
    """Level that is held, whether or not the newest reading could be judged."""

    change: FilmChangeModel | None
    """Null without a baseline, before the shortest time scale is full, and without a current
    reading."""

    deviation: FilmDeviationModel | None
    """Of the newest reading alone; null unless it was compared."""

    stiffness_n_per_m: float | None
    """Of the newest reading; null if there is no number."""

    cause: FilmCauseModel | None
    """While a level is held."""


class FilmLimitsModel(ApiModel):
    """From which change on a film is an alert or danger."""

    alert: Annotated[float, Field(examples=[0.035])]
    """Of ln of stiffness, either way: 0.04 is 4 %."""

    danger: Annotated[float, Field(examples=[0.15])]
    """Likewise."""


class FilmModel(ApiModel):
    """The film of a bearing now."""

    unit: str
    """Unit."""

    bearing: str
    """Bearing."""

    is_watched: bool
    """Whether its stiffness is compared with a baseline."""

    why_not: str | None
    """Why it is not; null if it is."""

    estimator: EstimatorName | None
    """Whose stiffness is watched: one and the same, so that like meets like."""

    time: Time | None
    """Newest reading; null if there has been none since the service started."""

    is_current: bool
    """Whether that reading is current."""

    next_reading: Time | None
    """When the next one is due; null without current data."""

    condition: FilmConditionModel | None
    """Of the newest result; null without current data."""

    baseline_version: int | None
    """What readings are compared with from now on; null if nothing is in force."""

    limits: FilmLimitsModel | None
    """Limits of change; null if it is not watched."""

    x: FilmDirectionModel | None
    """In x; null if it is not watched."""

    y: FilmDirectionModel | None
    """In y, likewise."""


class FilmWordModel(ApiModel):
    """A film in one direction, in a word."""

    verdict: VerdictName
    """As of its newest reading; "no_reading" if that is not current."""

    level: LevelHeldName | None
    """Level that is held."""

    change_percent: float | None
    """Most significant mean change of stiffness, %."""


class FilmBriefModel(ApiModel):
    """The film of a bearing at a glance."""

    bearing: str
    """Bearing."""

    why_not: str | None
    """Why it is not watched; null if it is."""

    x: FilmWordModel | None
    """In x; null if it is not watched."""

    y: FilmWordModel | None
    """In y, likewise."""
