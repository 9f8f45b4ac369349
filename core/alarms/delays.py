"""On- and off-delay of one level: a condition counts once it has been known to last."""

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class DelayTimer:
    """Whether a level counts, and for how long the condition has said otherwise.

    Parameters
    ----------
    opposed_ns
        Known time for which it has; what passes unseen does not count.
    last_ns
        When it last did; None if nothing was known since.
    """

    is_on: bool = False
    opposed_ns: int = 0
    last_ns: int | None = None

    def step(self, wanted: bool, now_ns: int, on_delay_ns: int, off_delay_ns: int) -> "DelayTimer":
        """Take in what the condition says now; a clock that was put back adds nothing."""
        if wanted == self.is_on:
            return ON if wanted else RESTED
        since_ns = now_ns if self.last_ns is None else self.last_ns
        opposed_ns = self.opposed_ns + max(0, now_ns - since_ns)
        if opposed_ns >= (on_delay_ns if wanted else off_delay_ns):
            return ON if wanted else RESTED
        return DelayTimer(self.is_on, opposed_ns, now_ns)

    def paused(self) -> "DelayTimer":
        """The timer when nothing is known: what is pending stays pending, and no time passes."""
        return self if self.last_ns is None else replace(self, last_ns=None)


RESTED = DelayTimer()
ON = DelayTimer(is_on=True)
