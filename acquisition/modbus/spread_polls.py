"""`SpreadPolls`: when a ring is polled, so that the device's clock can be told from its slots."""

_GOLDEN = (5.0**0.5 - 1.0) / 2.0
"""Multiples of it, without their whole part, fill an interval evenly (Weyl 1916)."""


class SpreadPolls:
    """Polls once a period, each a little early, so that they meet a slot at all of its ages.

    A slot shows when its last sample was taken only to a poll that comes as it is finished. Polls
    at strict multiples of a period meet all slots at nearly the same age, as their durations often
    have a small ratio; while a device drifts through a whole slot it then seems not to drift at
    all, and after that to jump.

    Parameters
    ----------
    period_s
        Above 0.
    slot_s
        Duration of a slot.
    """

    def __init__(self, period_s: float, slot_s: float, now_s: float) -> None:
        self._period_s = period_s
        self._most_early_s = min(slot_s, period_s)
        self._due_s = now_s
        self._n = 0

    def wait_s(self, now_s: float) -> float:
        """Time until the next poll; polls that are overdue are left out, never piled up."""
        self._n += 1
        self._due_s = max(self._due_s + self._period_s, now_s)
        early_s = self._most_early_s * (self._n * _GOLDEN % 1.0)
        return max(self._due_s - early_s - now_s, 0.0)
