"""What of a monitor cannot be had back by showing it the newest samples once more."""

from collections.abc import Mapping
from dataclasses import dataclass

from core.condition.probe_axes import Growth
from core.samples.gaps import SampleAccount


@dataclass(frozen=True)
class MonitorState:
    """A monitor at one moment, but for what its samples since `start` make of it.

    Parameters
    ----------
    epoch
        In which its samples are counted; None before the first.
    start
        First sample that it has to see once more.
    first_start
        First sample of what it counts as possible in this epoch.
    n_voided
        Segments that gaps have voided.
    growth
        By bearing.
    """

    epoch: int | None
    start: int
    first_start: int
    n_voided: int
    growth: Mapping[str, Growth]
    account: SampleAccount
