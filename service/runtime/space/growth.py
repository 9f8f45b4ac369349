"""`Growth`: how fast a disk fills, and when it will be full if that goes on."""

from collections import deque

from service.runtime.space.disk import DiskSpace

EVERY_S = 600.0
OVER_S = 86_400.0
"""What is written goes by the day: captures by alarms, copies by night."""

LEAST_S = 3600.0
"""Less time than this tells nothing."""

S_PER_DAY = 86_400.0


class Growth:
    """Remembers how much room there was, over a day."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, int]] = deque()

    def note(self, space: DiskSpace, now_s: float) -> None:
        """Take in what was measured; ``now_s`` is of a clock that only goes forward."""
        if not self._seen or now_s - self._seen[-1][0] >= EVERY_S:
            self._seen.append((now_s, space.free_bytes))
        while len(self._seen) > 2 and now_s - self._seen[1][0] >= OVER_S:
            self._seen.popleft()

    def days_until_full(self, space: DiskSpace, now_s: float) -> float | None:
        """From now on, at the pace of the last day; None if that is not known, or nothing grows."""
        if not self._seen:
            return None
        since_s, free_then = self._seen[0]
        lasted_s, taken = now_s - since_s, free_then - space.free_bytes
        if lasted_s < LEAST_S or taken <= 0:
            return None
        return space.free_bytes / taken * lasted_s / S_PER_DAY
