"""API models of the current state of an oil film."""

from typing import Annotated, Literal

from pydantic import Field

from core.machine.unit import Estimator
from service.api.values import ApiModel, BearingAnswer, ByName, FilmConditionModel, Time
from service.live.models import FilmCauseModel
from service.settings.alarm_kinds import AlarmLevelName

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


class FilmChangeModel(ApiModel):
    """Mean deviation from the baseline over the averaging time at which it is most significant."""

    time_scale_h: Annotated[float, Field(examples=[4.0])]
    """Averaging time, running hours."""

    percent: Annotated[float, Field(examples=[-19.2])]
    """Mean change, % of the expected value; negative if softer. The alarm limits apply to it.
    After a sudden change, it follows the deviation of the newest reading with delay."""

    significance: Annotated[float, Field(examples=[12.4])]
    """Absolute value of the change, divided by its standard uncertainty."""

    significance_wanted: Annotated[float, Field(examples=[6.5])]
    """Smallest significance at which a change with this averaging time can raise an alarm."""

    as_of: Time | None
    """Time of the newest reading in the average; null if this reading was made before the service
    started or before the baseline in force."""


class FilmDeviationModel(ApiModel):
    """Deviation of one reading from the baseline."""

    low_95: float
    high_95: float

    percent: float
    """Deviation, % of the expected stiffness."""


class FilmVerdictModel(ApiModel):
    """Verdict and alarm level of a film in one direction, x or y."""

    verdict: Annotated[VerdictName, ByName]
    """Verdict on the newest reading. Only "normal", "alert" and "danger" judge the film. The other
    verdicts state why it is not judged: too little evidence yet ("gathering_evidence"), no baseline
    for this condition ("no_baseline"), too little motion ("insufficient_excitation"), a doubtful
    value ("bad_quality"), a unit that has not settled ("transient"), or no current reading
    ("no_reading")."""

    level: Annotated[AlarmLevelName, ByName] | None
    """Alarm level in force, also while the newest reading cannot be judged; null if none."""


class FilmStiffnessModel(ApiModel):
    """Stiffness of a film in one direction, and the stiffness that its baseline expects."""

    stiffness_n_per_m: float | None
    stiffness_of_kb: float | None

    expected_n_per_m: float | None
    """Stiffness that the baseline expects under the condition of the newest reading, N/m; null if
    this reading was not compared."""

    expected_of_kb: float | None
    """Expected stiffness as such a ratio; null if the bracket stiffness is known."""


class FilmQuantityModel(FilmVerdictModel):
    """Verdict on a quantity of an oil film in one direction, x or y, with its change."""

    reason: Annotated[str, Field(examples=["condition_not_learned"])]
    """Reason why the film is not judged; "ok" if it is judged."""

    change: FilmChangeModel | None
    """Change against the baseline; null without a baseline, until the shortest averaging time has
    passed, and without a current reading."""

    deviation: FilmDeviationModel | None
    """Deviation of the newest reading alone; null if this reading was not compared."""

    cause: FilmCauseModel | None
    """Cause of the change while a level is in force; otherwise null."""


class FilmDampingModel(FilmQuantityModel):
    """Verdict on the ratio c/k of damping to stiffness of an oil film, with its change."""

    ck_s: float | None

    expected_s: float | None
    """Damping over stiffness that the baseline expects, s; null if it was not compared."""


class FilmDirectionModel(FilmQuantityModel, FilmStiffnessModel):
    """State of an oil film in one direction, x or y: stiffness, and damping over stiffness."""

    damping: FilmDampingModel


class FilmLimitsModel(ApiModel):
    """Alarm limits of the mean change of a film, separately for an increase and a decrease."""

    alert_percent: Annotated[float, Field(examples=[3.5])]
    """Limit for an alert, % of the expected value."""

    danger_percent: Annotated[float, Field(examples=[15.0])]
    """Limit for danger, % of the expected value."""


class FilmModel(BearingAnswer):
    """Current state of the oil film of a bearing."""

    why_not: str | None
    estimator: Estimator | None
    baseline_version: int | None
    limits: FilmLimitsModel | None
    x: FilmDirectionModel | None
    y: FilmDirectionModel | None

    is_watched: bool
    """Whether the film is watched: its stiffness is compared with a baseline."""

    time: Time | None
    """Time of the newest reading; null without a reading since the service started."""

    is_current: bool
    """Whether the newest reading is recent and the baseline in force has not changed since then."""

    next_reading: Time | None
    """Time at which the next reading is due; null without current data."""

    condition: FilmConditionModel | None
    """Operating condition of the bearing at the newest result; null without current data."""

    damping_limits: FilmLimitsModel | None
    """Alarm limits of damping over stiffness; null if the film is not watched."""


class FilmWordModel(FilmVerdictModel, FilmStiffnessModel):
    """Verdict, alarm level, stiffness and change of a film in one direction."""

    change_percent: float | None
    deviation_percent: float | None
    ck_level: AlarmLevelName | None
    ck_change_percent: float | None


class FilmBriefModel(ApiModel):
    """Summary of the oil film of a bearing."""

    why_not: str | None
    limits: FilmLimitsModel | None
    x: FilmWordModel | None
    y: FilmWordModel | None
