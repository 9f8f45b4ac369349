"""Hours in which what is no danger waits."""

from dataclasses import dataclass
from datetime import UTC, datetime, time
from zoneinfo import ZoneInfo

from core.units import NS_PER_S


@dataclass(frozen=True)
class QuietHours:
    """From start to end every day, over midnight if the end is before the start."""

    start: time
    end: time
    zone: ZoneInfo

    def hold_at(self, now_ns: int) -> bool:
        """Whether a moment lies within them."""
        moment = datetime.fromtimestamp(now_ns // NS_PER_S, UTC).astimezone(self.zone).time()
        if self.start < self.end:
            return self.start <= moment < self.end
        return moment >= self.start or moment < self.end
