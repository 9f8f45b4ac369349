"""What a back-test says, as `--json` prints it."""

from pydantic import BaseModel, ConfigDict


class _Part(BaseModel):
    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)


class ChangeReport(_Part):
    """A change of stiffness with its uncertainty."""

    percent: float
    """Of what the baseline says, under the same condition."""

    u_percent: float
    """Standard uncertainty of that, of a healthy film's mean."""

    time_scale_h: float
    """Running hours that were averaged over."""


class ConditionReport(_Part):
    """What a bearing ran under."""

    state: str
    eccentricity_ratio: float | None
    oil_temperature_c: float | None
    attitude_deg: float | None
    cell: tuple[int, ...] | None
    """Bins of eccentricity ratio, oil temperature and, where it counts, attitude angle."""


class CauseReport(_Part):
    """What an alarm is put down to."""

    cause: str
    reason: str
    film_share: float | None
    u_film_share: float | None


class AlarmReport(_Part):
    """An alarm."""

    unit: str
    bearing: str
    direction: str
    level: str
    """The highest that it reached."""

    begin: str
    danger: str | None
    """When it became a danger."""

    end: str | None
    """When it returned; null if it lasted to the end of readings or the next machine event."""

    baseline_version: int
    raised: ChangeReport
    largest: ChangeReport
    condition: ConditionReport
    """When it was raised."""

    cause: CauseReport
    """When it was raised."""

    later_cause: CauseReport
    """With the readings of the 24 hours after."""


class SupportReport(_Part):
    """What a baseline knows."""

    version: int
    event: str
    """Machine event that it began with; empty for the first."""

    learned_from: str
    learned_until: str
    """End of the readings that were learned from, this one not included."""

    is_learned: bool
    """False if there were too few readings."""

    cells_own: int
    cells_borrowed: int
    cells_without_support: int
    scatter_percent: float | None
    """Of single readings about what was learned."""

    rejected_percent: float | None
    """Of what was learned from, that fitted too badly to count."""


class FilmReport(_Part):
    """One bearing in one direction."""

    unit: str
    bearing: str
    direction: str
    rows: int
    """Of the file."""

    learning: int
    """Readings of learning periods; the others are counted by verdict."""

    verdicts: dict[str, int]
    judged_percent: float | None
    """Of the settled readings after learning, those that were called normal, alert or danger."""

    n_alarms: int
    baselines: list[SupportReport]


class RateReport(_Part):
    """How often it alarmed: on a healthy plant, the rate of false alarms."""

    unit_years: float
    """From the end of learning to the end of readings, all units together."""

    n_alarms: int
    n_danger: int
    alarms_per_unit_year: float | None


class BackTestReport(_Part):
    """All of it."""

    file: str
    rows: int
    films: list[FilmReport]
    alarms: list[AlarmReport]
    rate: RateReport
    doubts: list[str]
    duration_s: float
    readings_per_s: float
