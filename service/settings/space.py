"""How little room on the disk is an alarm."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.settings.base import MisfitError, Settings

Share = Annotated[float, Field(gt=0.0, lt=1.0)]
Gigabytes = Annotated[float, Field(gt=0.0, le=1_000_000.0)]


class SpaceSettings(Settings):
    """Free room on the disks of the data folder, below which the alarm disk_nearly_full is raised.

    What is reached first counts: the share of the disk, or the gigabytes.
    """

    alert_free_share: Share = 0.1
    """Free share of a disk below which it is an alert."""

    danger_free_share: Share = 0.05
    """Free share below which it is a danger; must be below alert_free_share."""

    alert_free_gb: Gigabytes = 2.0
    """Free GB (10^9 bytes) below which it is an alert; never more than a quarter of the disk."""

    danger_free_gb: Gigabytes = 1.0
    """Free GB below which it is a danger, at most an eighth of the disk; must be below
    alert_free_gb."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for unit in ("share", "gb"):
            alert, danger = (
                getattr(self, f"alert_free_{unit}"),
                getattr(self, f"danger_free_{unit}"),
            )
            if not danger < alert:
                limit = f"must be below alert_free_{unit}, {alert:g}"
                raise MisfitError(limit, f"danger_free_{unit}")
        return self
