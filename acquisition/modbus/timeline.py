"""Sample axis of a block ring: sample index of each slot, from its two 32-bit counters."""

from enum import StrEnum

from acquisition.modbus.ring_profile import U32, RingLayout, Slot
from core.samples.axis import ClockTolerance, Epochs, signed_distance
from core.units import NS_PER_S

_US_PER_S = 1_000_000
_TOLERANCE = ClockTolerance()

_MAX_MISCOUNTED = 8
"""Maximum number of successive slots with a wrong sequence number but correct index and time; a
longer run means that the device was reset."""


class Refusal(StrEnum):
    """Reason for refusing the samples of a slot; values name the counts of refused samples."""

    TORN = "torn_slot"
    DAMAGED = "damaged_slot"
    WRONG_SEQUENCE = "wrong_sequence"
    INCONSISTENT_INDEX = "inconsistent_index"
    IMPOSSIBLE_TIME = "impossible_time"


def ahead(sequence: int, of: int) -> int:
    """Return how far a 32-bit counter is ahead of another, across a wrap; negative if behind."""
    return signed_distance(sequence, of, U32)


class Timeline:
    """Sample axis of a block ring within one epoch; a reset of the counters starts a new epoch.

    A slot is accepted if sequence number and sample index have advanced equally since the last
    accepted slot. A single inconsistent slot is refused. Two successive slots that are consistent
    with each other show that the counters were reset, and start a new epoch. Up to eight slots with
    consistent index and time are refused without a new epoch: only their sequence number is wrong.
    Time stamps are otherwise not used here; `BlockAssembler` checks those of all sources.
    """

    def __init__(self, layout: RingLayout, epochs: Epochs) -> None:
        self._layout = layout
        self._miscounted = ClockTolerance(step_s=layout.slot_duration_s / 2.0)
        self._accepted: Slot | None = None
        self._accepted_index = 0
        self._refused: Slot | None = None
        self._n_miscounted = 0
        self.epochs = epochs

    def anchor(self, slot: Slot) -> None:
        """Start the axis at the sample index of a slot."""
        self._accept(slot, slot.first_index)

    def restart(self, slot: Slot) -> None:
        """Start a new epoch and axis at a slot, because the device's counters were reset."""
        self.epochs.begin()
        self.anchor(slot)

    def place(self, slot: Slot) -> int | Refusal:
        """Return the unwrapped index of a slot's first sample, or the reason for its refusal."""
        if slot.microseconds >= _US_PER_S:
            return Refusal.IMPOSSIBLE_TIME
        if self._accepted is None:
            self.anchor(slot)
        elif self._on_one_axis(self._accepted, slot):
            self._accept(slot, self._accepted_index + self._n_samples(self._accepted, slot))
        elif self._is_miscounted(self._accepted, slot) and self._n_miscounted < _MAX_MISCOUNTED:
            self._n_miscounted += 1
            self._refused = None
            return Refusal.INCONSISTENT_INDEX
        elif self._refused is not None and self._on_one_axis(self._refused, slot):
            self.restart(slot)
        else:
            self._refused = slot
            return Refusal.INCONSISTENT_INDEX
        return self._accepted_index

    def repeats(self, slot: Slot) -> bool:
        """Return whether a slot is an older slot of this axis, delivered again.

        A device that was reset repeats the counter values, but with other time stamps.
        """
        before = self._accepted
        if before is None or not self._on_one_axis(before, slot):
            return False
        return self._is_then(before, slot, self._n_samples(before, slot))

    def _accept(self, slot: Slot, index: int) -> None:
        self._accepted, self._accepted_index = slot, index
        self._refused, self._n_miscounted = None, 0

    def _is_miscounted(self, reference: Slot, slot: Slot) -> bool:
        """Return whether index and time of a slot agree, regardless of its sequence number.

        After a reset, index and time disagree: the index is low, the time at least two slots later.
        """
        n_samples = ahead(slot.first_index, reference.first_index)
        return self._is_then(reference, slot, n_samples, self._miscounted)

    def _is_then(
        self,
        reference: Slot,
        slot: Slot,
        n_samples: int,
        tolerance: ClockTolerance = _TOLERANCE,
    ) -> bool:
        """Return whether two time stamps differ by `n_samples` periods within the tolerance."""
        expected_ns = n_samples * 1000 * NS_PER_S // self._layout.rate_mhz
        deviation_ns = slot.start_ns - reference.start_ns - expected_ns
        return abs(deviation_ns) <= tolerance.over(expected_ns)

    def _on_one_axis(self, reference: Slot, slot: Slot) -> bool:
        n_samples = self._n_samples(reference, slot)
        return (slot.first_index - reference.first_index - n_samples) % U32 == 0

    def _n_samples(self, reference: Slot, slot: Slot) -> int:
        return ahead(slot.sequence, reference.sequence) * self._layout.samples_per_slot
