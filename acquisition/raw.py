"""`RawBlock`: samples as a device delivers them, before calibration; and what produces them."""

from dataclasses import dataclass
from typing import Protocol

from core.arrays import CountArray
from core.blocks import Rejection


@dataclass(frozen=True)
class RawBlock:
    """Consecutive samples as a device delivers them.

    Parameters
    ----------
    counts
        (n_channels, n_samples)
    ok
        (n_channels,) the device's own verdict on each channel.
    slow
        One value for each configured slow channel, NaN where the device has none.
    """

    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float
    counts: CountArray
    ok: tuple[bool, ...]
    slow: tuple[float, ...]
    rejected: tuple[Rejection, ...] = ()


class RawFeed(Protocol):
    """A device's converter: the simulated DAQ pulls its samples from one of these."""

    def advance(self, n_samples: int) -> RawBlock:
        """Produce the next samples, following directly on the previous ones."""
        ...
