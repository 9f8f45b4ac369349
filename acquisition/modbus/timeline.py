"""Sample axis of a block ring: slots placed by two 32-bit counters, and those that are refused."""

from enum import StrEnum

from acquisition.modbus.ring_profile import U32, RingLayout, Slot
from core.samples.axis import ClockTolerance, Epochs, signed_distance
from core.units import NS_PER_S

_US_PER_S = 1_000_000
_TOLERANCE = ClockTolerance()

_MAX_MISCOUNTED = 8
"""Longest run of slots whose sequence number alone may be wrong; a longer run means that the device
was reset."""


class Refusal(StrEnum):
    """Why the samples of a slot are not used; the names become counters."""

    TORN = "torn_slot"
    DAMAGED = "damaged_slot"
    WRONG_SEQUENCE = "wrong_sequence"
    INCONSISTENT_INDEX = "inconsistent_index"
    IMPOSSIBLE_TIME = "impossible_time"


def ahead(sequence: int, of: int) -> int:
    """Signed distance between two 32-bit counters, the short way round."""
    return signed_distance(sequence, of, U32)


class Timeline:
    """The sample axis of one epoch.

    A slot fits if sequence number and sample index have advanced by the same amount since the last
    slot that did. A single slot that does not is refused. Two in a row that agree with each other
    show that the counters were reset: a new epoch, since the old axis has ended. A few whose index
    and time go on as before, or back together, were written twice or counted wrongly: these are no
    reset. Else stamps decide nothing here; they are judged where all adapters' stamps are.
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
        """Start the axis at a slot, at the index it names itself."""
        self._accept(slot, slot.first_index)

    def restart(self, slot: Slot) -> None:
        """End the axis, since the device's counters went back, and start a new one."""
        self.epochs.begin()
        self.anchor(slot)

    def place(self, slot: Slot) -> int | Refusal:
        """Index of the slot's first sample on the unwrapped axis, or why it has none."""
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
        """Whether a slot is an older one of this axis, offered again.

        A device that was reset counts the same numbers again, but not at the same time.
        """
        before = self._accepted
        if before is None or not self._on_one_axis(before, slot):
            return False
        return self._is_then(before, slot, self._n_samples(before, slot))

    def _accept(self, slot: Slot, index: int) -> None:
        self._accepted, self._accepted_index = slot, index
        self._refused, self._n_miscounted = None, 0

    def _is_miscounted(self, reference: Slot, slot: Slot) -> bool:
        """Whether index and time agree about where a slot belongs, whatever its sequence number.

        A device that was reset lately counts low numbers at a later time, by two slots at least.
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
        """Whether a slot was taken so many samples after another one, by the device's clock."""
        expected_ns = n_samples * 1000 * NS_PER_S // self._layout.rate_mhz
        deviation_ns = slot.start_ns - reference.start_ns - expected_ns
        return abs(deviation_ns) <= tolerance.over(expected_ns)

    def _on_one_axis(self, reference: Slot, slot: Slot) -> bool:
        n_samples = self._n_samples(reference, slot)
        return (slot.first_index - reference.first_index - n_samples) % U32 == 0

    def _n_samples(self, reference: Slot, slot: Slot) -> int:
        return ahead(slot.sequence, reference.sequence) * self._layout.samples_per_slot
