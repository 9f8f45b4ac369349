"""`CountedInstants`: complete sample instants from messages that carry counters."""

from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.can.counter_axis import CounterAxis, Jump, Mark
from acquisition.can.plan import (
    Instant,
    MessageCounter,
    Part,
    PendingInstant,
    Plan,
    Refusal,
    RefusalCounts,
)
from acquisition.can.rivals import Rivals
from core.samples.axis import Epochs

MAX_PENDING = 64
"""Instants that may be incomplete at the same time."""

_MAX_TOLD = 256
"""Frames of each message that are remembered, to be compared with those that come again."""

_WIDE = 1 << 32
"""A counter of fewer samples than this wraps while nobody looks."""


@dataclass(frozen=True)
class Placed:
    """A frame whose place on the sample axis is known."""

    part: Part
    data: bytes
    index: int


@dataclass(frozen=True)
class _Doubted:
    part: Part
    data: bytes
    mark: Mark
    epoch: int | None


class CountedInstants:
    """Follows the counters; what it hands on is complete, in order, and exactly counted.

    Parameters
    ----------
    refused
        Where refused frames are counted.
    begun_ns
        When this life of the adapter began, UTC.

    Attributes
    ----------
    rivals
        Whether a second device counts under the same ids.
    """

    def __init__(
        self, plan: Plan, rate_hz: float, refused: RefusalCounts, begun_ns: int = 0
    ) -> None:
        self._plan = plan
        self._refused = refused
        self._axis = CounterAxis(rate_hz, plan.samples_per_frame)
        self._tells_epoch = any(
            part.epoch and part.counter for m in plan.messages.values() for part in m.parts.values()
        )
        is_wide = plan.widest_modulus >= _WIDE
        self._epochs = Epochs(begun_ns, trusts_device=self._tells_epoch and is_wide)
        self._told_epoch: int | None = None
        self._doubted: list[_Doubted] = []
        self._left: tuple[Mark, int | None] | None = None
        self.rivals = Rivals()
        self._incomplete = 0
        self._unusable: list[int] = []
        self._begin()

    @property
    def epoch(self) -> int:
        """Number of the present count."""
        return self._epochs.number

    @property
    def now(self) -> int | None:
        """Index from which on a message that came just now holds; None before the first frame."""
        newest = self._axis.newest
        return None if newest is None else max(self._stop, newest)

    def begin_epoch(self) -> int:
        """Begin another count that goes on at the same index; return its number."""
        self._epochs.begin()
        return self.epoch

    def refuse_frame(self, part: Part) -> None:
        """Note that a frame of a message came but could not be used."""
        if part.wave is not None:
            self._unusable[part.wave] += self._plan.samples_per_frame

    def take(
        self, part: Part, counter: MessageCounter, data: bytes, arrived_ns: int
    ) -> list[Placed]:
        """Place a frame; a doubted one comes with the one that confirms it."""
        raw = int(counter.read(data)) * counter.step
        told = int(part.epoch(data)) if part.epoch else None
        if not self._doubted and (told is None or told == self._told_epoch):
            index = self._axis.place(raw, counter.modulus, arrived_ns)
            if index is not None:
                return [Placed(part, data, index)]
        return self._doubt(_Doubted(part, data, Mark(raw, counter.modulus, arrived_ns), told))

    def complete(self, placed: Placed) -> Instant | None:
        """Put a waveform frame to the others of its instant; return that, if it is complete."""
        part, index, wave = placed.part, placed.index, placed.part.wave
        if wave is None:
            return None
        last = self._last[wave]
        if index <= last or index < self._stop:
            self._refuse_old(wave, index, placed.data)
            return None
        self.rivals.fits()
        self._last[wave] = index
        self._remember(wave, index, placed.data)
        n_samples = self._n_samples(part, placed.data)
        pending = self._pending.get(index)
        if pending is None:
            pending = self._pending[index] = PendingInstant(self._plan.n_waves, n_samples)
        frames = pending.put(wave, placed.data, n_samples)
        if frames is None:
            self._give_up_oldest()
            return None
        return self._finished(index, pending.n_samples, frames)

    def _refuse_old(self, wave: int, index: int, data: bytes) -> None:
        """Count a frame of a sample that is past; a device alone never tells one in two ways."""
        if self._contradicts(self._told[wave], index, data):
            self._refused[Refusal.CONTRADICTORY] += 1
            self.rivals.contradicts()
            return
        again = Refusal.DUPLICATE if index == self._last[wave] else Refusal.OUT_OF_ORDER
        self._refused[again] += 1

    def _contradicts(self, told: Mapping[int, bytes], index: int, data: bytes) -> bool:
        if index in told:
            return told[index] != data
        n_samples = self._plan.samples_per_frame
        return any(n in told for n in range(index - n_samples + 1, index + n_samples))

    def _remember(self, wave: int, index: int, data: bytes) -> None:
        told = self._told[wave]
        told[index] = data
        if len(told) > _MAX_TOLD:
            del told[next(iter(told))]

    def _doubt(self, frame: _Doubted) -> list[Placed]:
        """Wait for a second frame where the first does not fit the axis."""
        mark = frame.mark
        if self._axis.newest is None:
            if mark.modulus < self._plan.widest_modulus:
                self._refused[Refusal.BEFORE_START] += 1
                return []
            if frame.epoch is not None:
                self._told_epoch = frame.epoch
                self._epochs.begin_first(frame.epoch)
            self._axis.anchor(mark.counter, mark.arrived_ns)
            return [Placed(frame.part, frame.data, mark.counter)]
        if self._doubted and self._confirms(frame):
            return self._move([*self._doubted, frame])
        same_epoch = frame.epoch is None or frame.epoch == self._told_epoch
        index = self._axis.place(mark.counter, mark.modulus, mark.arrived_ns)
        for _ in self._doubted:
            self._refused[Refusal.IMPOSSIBLE_COUNTER] += 1
            self.rivals.contradicts()
        self._doubted.clear()
        if index is not None and same_epoch:
            return [Placed(frame.part, frame.data, index)]
        self._doubted.append(frame)
        return []

    def _confirms(self, frame: _Doubted) -> bool:
        last = self._doubted[-1]
        repeats = last.part is frame.part and last.mark.counter == frame.mark.counter
        other_epoch = frame.epoch is not None and frame.epoch != self._epoch_of(self._doubted)
        return not repeats and not other_epoch and self._axis.agrees(last.mark, frame.mark)

    def _epoch_of(self, frames: list[_Doubted]) -> int | None:
        told = [frame.epoch for frame in frames if frame.epoch is not None]
        return told[-1] if told else self._told_epoch

    def _move(self, frames: list[_Doubted]) -> list[Placed]:
        """Go on at the place where frames agree that the device is."""
        self._doubted = []
        widest = max(frames, key=lambda frame: frame.mark.modulus)
        epoch = self._epoch_of(frames)
        left = (self._axis.left(widest.mark.modulus), self._told_epoch)
        if epoch != self._told_epoch:
            kind, index = Jump.RESTART, widest.mark.counter
            self._epochs.begin(epoch)
        elif self._tells_epoch and all(frame.epoch is None for frame in frames):
            kind, index = Jump.GAP, self._axis.gap(widest.mark)
        else:
            kind, index = self._axis.jump(widest.mark, self._tells_epoch)
            if kind is Jump.RESTART:
                self._epochs.begin()
        if kind is Jump.RESTART:
            self._begin()
            if self._goes_on(widest.mark, epoch):
                self.rivals.returns()
        self._left = left
        self._told_epoch = epoch
        self._axis.anchor(index, widest.mark.arrived_ns)
        return [Placed(f.part, f.data, self._near(f.mark, index)) for f in frames]

    def _goes_on(self, mark: Mark, epoch: int | None) -> bool:
        """Whether a count goes on that was left for another one a moment ago."""
        if self._left is None or self._left[1] != epoch:
            return False
        left = self._left[0]
        return left.modulus == mark.modulus and self._axis.resumes(left, mark)

    def _near(self, mark: Mark, index: int) -> int:
        half = mark.modulus // 2
        place = index + (mark.counter - index + half) % mark.modulus - half
        self._axis.anchor(max(self._axis.newest or 0, place), mark.arrived_ns)
        return place

    def _n_samples(self, part: Part, data: bytes) -> int:
        most = self._plan.samples_per_frame
        return most if part.n_samples is None else min(most, int(part.n_samples(data)))

    def _give_up_oldest(self) -> None:
        if len(self._pending) > MAX_PENDING:
            oldest = min(self._pending)
            self._incomplete += self._pending.pop(oldest).n_samples

    def _finished(self, index: int, n_samples: int, frames: tuple[bytes, ...]) -> Instant | None:
        """Hand an instant on; those before it will never be complete, since all parts are past."""
        for earlier in [i for i in self._pending if i <= index]:
            given_up = self._pending.pop(earlier)
            self._incomplete += given_up.n_samples if earlier < index else 0
        if n_samples == 0:
            return None
        rejected = self._rejected(index)
        self._stop = index + n_samples
        return Instant(self.epoch, index, n_samples, frames, rejected)

    def _rejected(self, index: int) -> dict[Refusal, int]:
        """What of the jump up to an index was refused; the rest of it never came."""
        n_jump = index - self._stop if self._stop >= 0 else 0
        incomplete = min(self._incomplete, n_jump)
        unusable = min(min(self._unusable), n_jump - incomplete)
        self._incomplete = 0
        self._unusable = [0] * self._plan.n_waves
        found = {Refusal.INCOMPLETE: incomplete, Refusal.WRONG_LENGTH: unusable}
        return {reason: n for reason, n in found.items() if n}

    def _begin(self) -> None:
        """Forget what belongs to the epoch that has ended."""
        self._pending: dict[int, PendingInstant] = {}
        self._last = [-1] * self._plan.n_waves
        self._told: list[dict[int, bytes]] = [{} for _ in range(self._plan.n_waves)]
        self._stop = -1
        self._incomplete = 0
        self._unusable = [0] * self._plan.n_waves
