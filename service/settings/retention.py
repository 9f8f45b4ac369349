"""For how long what is kept how finely."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.settings.base import MisfitError, Settings

Days = Annotated[float, Field(ge=0.0, le=36_500.0)]
FINER = (
    ("readings_days", "minutes_days"),
    ("minutes_days", "ten_minutes_days"),
)


class RetentionSettings(Settings):
    """Ages beyond which results are kept coarser only, in days; 0 keeps them for ever.

    One bearing takes 3 GB a year as single results, 2.2 GB as minutes, 0.25 GB as ten minutes and
    0.05 GB as hours, at the default refresh of 12 s. Kept for ever: hours with minimum, maximum,
    mean, count and worst quality; alarms and their history; baselines, references, the audit trail.
    """

    readings_days: Days = 400.0
    """Single results of bearings: a year and a month, so that every season has its counterpart."""

    minutes_days: Days = 400.0
    """Results by the minute; not below readings_days."""

    ten_minutes_days: Days = 3660.0
    """Results by ten minutes; not below minutes_days."""

    films_days: Days = 0.0
    """Readings of films, which baselines are learned from, 0.8 GB a year for each bearing."""

    messages_days: Days = 400.0
    """Messages to receivers that were delivered, refused or given up. What waits, waits; of each
    alarm the last one is kept."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for finer, coarser in FINER:
            least, found = getattr(self, finer), getattr(self, coarser)
            if (found and not least) or 0.0 < found < least:
                limit = "0" if not least else f"at least {finer}, {least:g}, or 0"
                raise MisfitError(f"must be {limit}", coarser)
        return self
