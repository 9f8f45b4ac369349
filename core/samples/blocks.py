"""`SampleBlock`: what every adapter delivers and everything downstream consumes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from core.arrays import SampleArray
from core.quality import Quality, Reading
from core.units import ns_from_s

UNCOUNTED_LOSS = "uncounted_loss"
"""Reason of the loss of samples that were not counted: their number follows from the time."""


@dataclass(frozen=True)
class Rejection:
    """Samples that a device offered and the adapter refused, directly before a block.

    Parameters
    ----------
    reason
        Short snake-case word, used as a counter's label.
    n_samples
        Per channel.
    """

    reason: str
    n_samples: int

    @property
    def is_estimated(self) -> bool:
        """Whether the number of samples follows from the time, not from a counter."""
        return self.reason == UNCOUNTED_LOSS


class StampFault(StrEnum):
    """What is wrong with a device's time stamp; the names become counters."""

    REGRESSED = "stamp_regressed"
    REPEATED = "stamp_repeated"
    JUMPED = "stamp_jumped"


@dataclass(frozen=True)
class DeviceClock:
    """A device's clocks, as seen from the host's.

    Parameters
    ----------
    offset_s
        How far the device's stamps are ahead of the host's clock, at the least delay seen on the
        way; None if the device does not stamp.
    drift_ppm
        How much faster than nominal the device samples by the host's clock, in parts per million;
        None until there are enough arrivals, and where the device samples when polled.
    u_drift_ppm
        Its standard uncertainty.
    n_faults
        Blocks since the start whose own stamp was not used.
    """

    offset_s: float | None
    drift_ppm: float | None
    u_drift_ppm: float | None
    n_faults: int = 0


class BlockMisfitError(ValueError):
    """A block does not fit the unit: it has another rate or other channels, or is another's."""


@dataclass(frozen=True)
class SampleBlock:
    """Consecutive samples of all waveform channels of one unit.

    Parameters
    ----------
    unit
        Identifier of the generating unit.
    epoch
        Changes when the device restarts its sample count.
    first_index
        Index of the first sample in this epoch, never wrapping.
    start_ns
        Time of the first sample, UTC nanoseconds since 1970.
    rate_hz
        Samples per second and channel.
    samples
        (n_channels, n_samples) in the engineering unit of each channel.
    channel_quality
        One for each channel, valid for the whole block.
    slow
        Slowly changing readings that belong to the time of the block, by slow channel.
    rejected
        What was refused between the previous block and this one; the rest of a jump in
        ``first_index`` is a gap.
    clock
        How the device's clock stands against the host's; None if there is no such clock.
    stamp_fault
        Why the device's own time stamp was not used: ``start_ns`` then follows from the index.
    sampled_s
        When the device had its last sample, by the steady clock of the host that has read it, as
        far as that is known; None if it comes from no device. Ages are counted from here: what
        a device, a link or a queue has held back is not new when it comes.
    """

    unit: str
    epoch: int
    first_index: int
    start_ns: int
    rate_hz: float
    samples: SampleArray
    channel_quality: tuple[Quality, ...]
    slow: Mapping[str, Reading] = field(default_factory=dict)
    rejected: tuple[Rejection, ...] = ()
    clock: DeviceClock | None = None
    stamp_fault: StampFault | None = None
    sampled_s: float | None = None

    def __post_init__(self) -> None:
        if self.samples.ndim != 2 or len(self.channel_quality) != self.samples.shape[0]:
            raise ValueError(
                f"samples of shape {self.samples.shape} need a quality per channel,"
                f" got {len(self.channel_quality)}"
            )

    @property
    def n_samples(self) -> int:
        """Samples per channel."""
        return int(self.samples.shape[1])

    @property
    def stop_index(self) -> int:
        """Index of the first sample after the block."""
        return self.first_index + self.n_samples

    @property
    def stop_ns(self) -> int:
        """Time of the first sample after the block."""
        return self.start_ns + ns_from_s(self.n_samples / self.rate_hz)

    def from_sample(self, start: int, stop: int | None = None) -> "SampleBlock":
        """Return a part of the block, counted from its own start; what was rejected stays in front.

        Raises
        ------
        ValueError
            If the part begins outside the block.
        """
        if not 0 <= start <= self.n_samples:
            raise ValueError(f"part from sample {start} of a block of {self.n_samples}")
        return replace(
            self,
            first_index=self.first_index + start,
            start_ns=self.start_ns + ns_from_s(start / self.rate_hz),
            samples=self.samples[:, start:stop],
            rejected=() if start else self.rejected,
        )
