"""What is kept of alarms beside their samples: settings of bundles of evidence."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.settings.base import MisfitError, Settings


class EvidenceSettings(Settings):
    """Evidence of alarms, in the data folder: what was known when one was raised."""

    max_gb: Annotated[float, Field(gt=0.0, le=10_000.0)] = 2.0
    """Space of all of it together, GB (10^9 bytes); beyond it the oldest is removed that is older
    than keep_days."""

    hard_max_gb: Annotated[float, Field(gt=0.0, le=10_000.0)] = 4.0
    """Beyond this the oldest is removed however young it is, GB; must not be below max_gb."""

    keep_days: Annotated[float, Field(ge=0.0, le=36_500.0)] = 30.0
    """Younger evidence stays as long as there is room below hard_max_gb, days."""

    max_per_alarm: Annotated[int, Field(ge=1, le=100_000)] = 200
    """Occurrences that are kept of one alarm, so that one that chatters pushes out no other."""

    trend_days: Annotated[float, Field(ge=0.1, le=366.0)] = 14.0
    """How long before an alarm the readings of its film are kept with it, days."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.hard_max_gb < self.max_gb:
            raise MisfitError(f"must not be below max_gb, {self.max_gb:g}", "hard_max_gb")
        return self
