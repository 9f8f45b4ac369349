"""`SpaceLimits`: how little room is an alarm."""

from dataclasses import dataclass

from core.limits import Limits

MOST_ALERT, MOST_DANGER = 0.25, 0.125
"""Shares that limits in bytes come to at most, so that a small disk can be in order at all."""

DEADBAND_SHARE = 0.2
"""Of the lower limit: who has made room should have made some."""


@dataclass(frozen=True)
class SpaceLimits:
    """Below which free room there is an alarm; what is reached first counts.

    Parameters
    ----------
    alert_share, danger_share
        Of the disk, 0 to 1.
    alert_bytes, danger_bytes
        Whatever the size of the disk.
    """

    alert_share: float = 0.1
    danger_share: float = 0.05
    alert_bytes: int = 2_000_000_000
    danger_bytes: int = 1_000_000_000

    def of(self, total_bytes: int) -> Limits:
        """Limits of the free share of a disk."""
        whole = max(total_bytes, 1)
        alert = max(self.alert_share, min(self.alert_bytes / whole, MOST_ALERT))
        danger = max(self.danger_share, min(self.danger_bytes / whole, MOST_DANGER))
        return Limits(alert_below=alert, danger_below=danger, deadband=DEADBAND_SHARE * danger)
