"""`RawBlock`: samples as a device delivers them, before calibration."""

from dataclasses import dataclass

from core.arrays import RawArray
from core.samples.blocks import Rejection


@dataclass(frozen=True)
class RawBlock:
    """Consecutive samples as a device delivers them.

    Parameters
    ----------
    counts
        (n_channels, n_samples) int16 counts of the converter; or, from a device that has none,
        float32 engineering units, not a number where the device has no sample.
    start_ns
        Time of the first sample, by the device's stamps or by the host's clock.
    ok
        (n_channels,) the device's own verdict on each channel.
    slow
        One value for each configured slow channel, NaN where the device has none.
    """

    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float
    counts: RawArray
    ok: tuple[bool, ...]
    slow: tuple[float, ...]
    rejected: tuple[Rejection, ...] = ()

    @property
    def n_samples(self) -> int:
        """Samples per channel."""
        return int(self.counts.shape[1])

    @property
    def stop_index(self) -> int:
        """Index of the first sample after the block."""
        return self.first_index + self.n_samples
