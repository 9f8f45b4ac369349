"""Sample instants: complete sets of frames, and whether a single device sends them."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from acquisition.can.plan import Part, Plan, Refusal, RefusalCounts

MAX_PENDING = 64
"""Instants that may be incomplete at the same time."""

_MAX_REMEMBERED = 256
"""Frames of each message that are remembered, to be compared with those that come again."""

_WINDOW_FRAMES = 100
_CONFLICT_SHARE = 0.2
"""A device that is alone repeats itself at most, or now and then sends a frame that is spoilt."""

_CLEAN_WINDOWS = 4


class DuplicateSenderDetector:
    """Weighs waveform frames that fit the count against those that contradict it.

    Two devices that send under the same ids contradict each other, and no sample of them can be
    believed. The verdict holds until four windows without many contradictions have passed: devices
    that send in turns do not contradict each other all the time.
    """

    def __init__(self) -> None:
        self._n_windows_to_wait = 0
        self._n_fitting = self._n_contrary = 0

    @property
    def found(self) -> bool:
        """Whether there is a second device."""
        return self._n_windows_to_wait > 0

    def note_fit(self) -> None:
        """Note a frame that one device alone would have sent."""
        self._n_fitting += 1
        self._judge()

    def note_contradiction(self) -> None:
        """Note a frame that does not go with the others."""
        self._n_contrary += 1
        self._judge()

    def note_return(self) -> None:
        """Note that a replaced count continues: no single device does that."""
        self._end_window(contrary=True)

    def _judge(self) -> None:
        n_frames = self._n_fitting + self._n_contrary
        if n_frames >= _WINDOW_FRAMES:
            self._end_window(contrary=self._n_contrary >= _CONFLICT_SHARE * n_frames)

    def _end_window(self, *, contrary: bool) -> None:
        waiting = max(0, self._n_windows_to_wait - 1)
        self._n_windows_to_wait = _CLEAN_WINDOWS if contrary else waiting
        self._n_fitting = self._n_contrary = 0


class PlacedFrame(NamedTuple):
    """A frame whose place on the sample axis is known."""

    part: Part
    data: bytes
    first_index: int


@dataclass(frozen=True)
class Instant:
    """A complete set of frames.

    Parameters
    ----------
    epoch
        Of the device's count.
    index
        Of the first sample.
    n_samples
        Valid samples of each channel, at most those that a frame can carry.
    frames
        One for each waveform message.
    rejected
        Samples refused directly before, by reason.
    """

    epoch: int
    index: int
    n_samples: int
    frames: tuple[bytes, ...]
    rejected: Mapping[Refusal, int] = field(default_factory=dict)

    @property
    def stop_index(self) -> int:
        """Index of the first sample after it."""
        return self.index + self.n_samples


@dataclass
class _Pending:
    """A set of frames, by number of the message, that is still being collected."""

    n_samples: int
    frames: dict[int, bytes] = field(default_factory=dict)
    is_spoilt: bool = False


class FrameSets:
    """Collects the frames of each sample instant; what it returns is complete and in order.

    Parameters
    ----------
    refused
        Where refused frames are counted.
    """

    def __init__(
        self, plan: Plan, refused: RefusalCounts, senders: DuplicateSenderDetector
    ) -> None:
        self._plan, self._refused, self._senders = plan, refused, senders
        self.begin()

    def begin(self) -> None:
        """Forget what belongs to the epoch that has ended."""
        n_waves = self._plan.n_waves
        self.pending: dict[int, _Pending] = {}
        self._seen: list[dict[int, bytes]] = [{} for _ in range(n_waves)]
        self.stop = -1 if self._plan.counted else 0
        self._n_incomplete = self._n_lost = 0
        self._n_unusable = [0] * n_waves

    def refuse(self, wave: int) -> None:
        """Note that a counted frame of a waveform message came but could not be used."""
        self._n_unusable[wave] += self._plan.samples_per_frame

    def open(self, index: int) -> None:
        """Begin a set, whether or not a frame of it can be used."""
        self.pending.setdefault(index, _Pending(self._plan.samples_per_frame))

    def lose(self, n_samples: int, n_dropped: int) -> None:
        """Move the sets that are still collected, since samples before them were lost.

        Parameters
        ----------
        n_dropped
            Samples of complete sets that cannot be used since others among them were lost.
        """
        self._n_lost += n_samples + n_dropped
        self.pending = {index + n_samples: found for index, found in self.pending.items()}

    def add(self, frame: PlacedFrame, epoch: int) -> Instant | None:
        """Put a frame to the others of its instant; return that, if it is complete."""
        part, data, index = frame
        wave = part.wave
        if wave is None or not self._is_new(wave, index, data):
            return None
        n_samples = self._plan.samples_per_frame
        if part.n_samples is not None:
            n_samples = min(n_samples, int(part.n_samples(data)))
        pending = self.pending.get(index)
        if pending is None:
            pending = self.pending[index] = _Pending(n_samples)
        pending.frames[wave] = data
        pending.is_spoilt |= n_samples != pending.n_samples
        if len(pending.frames) == self._plan.n_waves and not pending.is_spoilt:
            return self._finished(epoch, index, pending)
        if len(self.pending) > MAX_PENDING:
            self._n_incomplete += self.pending.pop(min(self.pending)).n_samples
        return None

    def _is_new(self, wave: int, index: int, data: bytes) -> bool:
        """Whether a frame is of a sample that is not past; it is then remembered."""
        seen = self._seen[wave]
        last = next(reversed(seen), -1)
        if index <= last or index < self.stop:
            self._refuse_old(seen, index, data)
            return False
        self._senders.note_fit()
        seen[index] = data
        if len(seen) > _MAX_REMEMBERED:
            del seen[next(iter(seen))]
        return True

    def _refuse_old(self, seen: dict[int, bytes], index: int, data: bytes) -> None:
        """Count a frame of a sample that is past; a device alone never sends one in two ways."""
        n_samples = self._plan.samples_per_frame
        near = range(index - n_samples + 1, index + n_samples)
        if seen[index] != data if index in seen else any(n in seen for n in near):
            self._refused[Refusal.CONTRADICTORY] += 1
            self._senders.note_contradiction()
            return
        again = index == next(reversed(seen), -1)
        self._refused[Refusal.DUPLICATE if again else Refusal.OUT_OF_ORDER] += 1

    def _finished(self, epoch: int, index: int, complete: _Pending) -> Instant | None:
        """Hand an instant on; those before it will never be complete, since all parts are past."""
        for earlier in [i for i in self.pending if i <= index]:
            given_up = self.pending.pop(earlier)
            self._n_incomplete += given_up.n_samples if earlier < index else 0
        if complete.n_samples == 0:
            return None
        rejected = self._rejected(index)
        self.stop = index + complete.n_samples
        frames = tuple(complete.frames[wave] for wave in range(self._plan.n_waves))
        return Instant(epoch, index, complete.n_samples, frames, rejected)

    def _rejected(self, index: int) -> dict[Refusal, int]:
        """What of the jump up to an index was refused; the rest of it never came."""
        n_jump = index - self.stop if self.stop >= 0 else 0
        incomplete = min(self._n_incomplete, n_jump)
        unusable = min(*self._n_unusable, n_jump - incomplete)
        found = {
            Refusal.INCOMPLETE: incomplete,
            Refusal.WRONG_LENGTH: unusable,
            Refusal.UNCOUNTED_LOSS: self._n_lost,
        }
        self._n_incomplete = self._n_lost = 0
        self._n_unusable = [0] * self._plan.n_waves
        return {reason: n for reason, n in found.items() if n}
