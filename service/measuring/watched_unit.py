"""`WatchedUnit`: a unit of the plant as the program runs it."""

from dataclasses import dataclass

from acquisition.source import SampleSource
from core.monitor.monitor import UnitMonitor


@dataclass(frozen=True)
class WatchedUnit:
    """A unit's source and the monitor that its blocks go to.

    Parameters
    ----------
    retry_s
        Longest wait before a lost link is tried again: the source's poll period, so that the first
        sample is here within two of them after the device is back.
    """

    source: SampleSource
    monitor: UnitMonitor
    retry_s: float = 0.5
