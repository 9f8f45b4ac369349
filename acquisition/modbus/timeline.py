"""From 32-bit counters to one unbroken sample axis, and what does not fit it."""

from enum import StrEnum

from acquisition.modbus.profile import U32, RingLayout, Slot

_NS_PER_S = 1_000_000_000
_CLOCK_TOLERANCE_NS = _NS_PER_S
_CLOCK_DRIFT = 1e-3
"""A device's clock may be corrected by a second and run a permille wrong; the index is exact."""


class Refusal(StrEnum):
    """Why the samples of a slot are not used; the names become counters."""

    TORN = "torn_slot"
    WRONG_SEQUENCE = "wrong_sequence"
    INCONSISTENT_INDEX = "inconsistent_index"
    IMPOSSIBLE_TIME = "impossible_time"


def ahead(sequence: int, of: int) -> int:
    """Signed distance between two 32-bit counters, the short way round."""
    return (sequence - of + U32 // 2) % U32 - U32 // 2


class Timeline:
    """The sample axis of one epoch.

    A slot fits if sequence number, sample index and time have advanced by the same amount since
    the last slot that did. A single slot that does not is refused. Two in a row that agree with
    each other show that the device's clock was set (accepted from then on) or that its counters
    were reset (a new epoch, since the old axis has ended).
    """

    def __init__(self, layout: RingLayout) -> None:
        self._layout = layout
        self._accepted: Slot | None = None
        self._accepted_index = 0
        self._refused: Slot | None = None
        self.n_resets = 0

    def anchor(self, slot: Slot) -> None:
        """Start the axis at a slot, at the index it names itself."""
        self._accepted, self._accepted_index, self._refused = slot, slot.first_index, None

    def restart(self, slot: Slot) -> None:
        """End the axis, since the device's counters went back, and start a new one."""
        self.n_resets += 1
        self.anchor(slot)

    def place(self, slot: Slot) -> int | Refusal:
        """Index of the slot's first sample on the unwrapped axis, or why it has none."""
        if slot.microseconds >= 1_000_000:
            return Refusal.IMPOSSIBLE_TIME
        if self._accepted is None:
            self.anchor(slot)
            return self._accepted_index
        misfit = self._misfit(self._accepted, slot)
        if misfit is not None and (self._refused is None or self._misfit(self._refused, slot)):
            self._refused = slot
            return misfit
        if misfit is Refusal.INCONSISTENT_INDEX:
            self.restart(slot)
        else:
            self._accepted_index += self._n_samples(self._accepted, slot)
            self._accepted, self._refused = slot, None
        return self._accepted_index

    def repeats(self, slot: Slot) -> bool:
        """Whether a slot is an older one of this axis, offered again."""
        return self._accepted is not None and self._misfit(self._accepted, slot) is None

    def _misfit(self, reference: Slot, slot: Slot) -> Refusal | None:
        n_samples = self._n_samples(reference, slot)
        if (slot.first_index - reference.first_index - n_samples) % U32:
            return Refusal.INCONSISTENT_INDEX
        expected_ns = n_samples * 1000 * _NS_PER_S // self._layout.rate_mhz
        elapsed_ns = slot.start_ns - reference.start_ns
        tolerance_ns = _CLOCK_TOLERANCE_NS + _CLOCK_DRIFT * abs(expected_ns)
        backwards = elapsed_ns * n_samples < 0 or (elapsed_ns == 0) != (n_samples == 0)
        if backwards or abs(elapsed_ns - expected_ns) > tolerance_ns:
            return Refusal.IMPOSSIBLE_TIME
        return None

    def _n_samples(self, reference: Slot, slot: Slot) -> int:
        return ahead(slot.sequence, reference.sequence) * self._layout.samples_per_slot
