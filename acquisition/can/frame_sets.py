"""Assembly of frames to sample instants, and detection of duplicate senders."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from acquisition.can.plan import Part, Plan, Refusal, RefusalCounts

MAX_PENDING = 64
"""Maximum number of incomplete instants at the same time."""

_MAX_REMEMBERED = 256
"""Number of recent frames stored per message, for comparison with repeated frames."""

_WINDOW_FRAMES = 100
_CONFLICT_SHARE = 0.2
"""Share of contradictory frames that shows a second sender; a single device has few."""

_CLEAN_WINDOWS = 4


class DuplicateSenderDetector:
    """Detector of two devices that send the same frame ids.

    Waveform frames of two devices contradict each other, and none of their samples are valid. The
    detection is cleared after four windows of 100 frames with few contradictions, because two
    devices that send alternately do not contradict each other in every window.
    """

    def __init__(self) -> None:
        self._n_windows_to_wait = self._n_frames = self._n_contrary = 0

    @property
    def found(self) -> bool:
        """Whether a second sender is detected."""
        return self._n_windows_to_wait > 0

    def note(self, *, contrary: bool) -> None:
        """Count a frame; `contrary` is whether it contradicts a single sender of all frames."""
        self._n_frames += 1
        self._n_contrary += contrary
        if self._n_frames >= _WINDOW_FRAMES:
            self._end_window(contrary=self._n_contrary >= _CONFLICT_SHARE * self._n_frames)

    def note_return(self) -> None:
        """Record that an earlier counter sequence continues, which shows a second sender."""
        self._end_window(contrary=True)

    def _end_window(self, *, contrary: bool) -> None:
        waiting = max(0, self._n_windows_to_wait - 1)
        self._n_windows_to_wait = _CLEAN_WINDOWS if contrary else waiting
        self._n_frames = self._n_contrary = 0


class PlacedFrame(NamedTuple):
    """Data of a frame, with its place in the decoding plan and the index of its first sample."""

    part: Part
    data: bytes
    first_index: int


@dataclass(frozen=True)
class Instant:
    """Sample instant: complete set of the frames, one per waveform message, at one index.

    Parameters
    ----------
    index
        Index of the first sample.
    n_samples
        Number of valid samples per channel, at most the capacity of a frame.
    frames
        Data of the frame of each waveform message.
    rejected
        Number of samples refused directly before the instant, by reason.
    """

    index: int
    n_samples: int
    frames: tuple[bytes, ...]
    rejected: Mapping[Refusal, int] = field(default_factory=dict)

    @property
    def stop_index(self) -> int:
        """Index after the last sample."""
        return self.index + self.n_samples


@dataclass
class _Pending:
    """Incomplete set of frames by number of the waveform message."""

    n_samples: int
    frames: dict[int, bytes] = field(default_factory=dict)
    is_spoilt: bool = False


class FrameSets:
    """Collector of the frames of each sample instant of an epoch; returns complete ones in order.

    `refused` are the counts of refused frames, which are updated in place.
    """

    def __init__(
        self, plan: Plan, refused: RefusalCounts, senders: DuplicateSenderDetector
    ) -> None:
        self._plan, self._refused, self._senders = plan, refused, senders
        self.pending: dict[int, _Pending] = {}
        self._seen: list[dict[int, bytes]] = [{} for _ in range(plan.n_waves)]
        self.stop = -1 if plan.counted else 0
        self._n_incomplete = self._n_lost = 0
        self._n_unusable = [0] * plan.n_waves

    def refuse(self, wave: int) -> None:
        """Count the samples of a wrong-length frame; `wave` is the index of its message."""
        self._n_unusable[wave] += self._plan.samples_per_frame

    def open(self, index: int) -> None:
        """Start the set of frames at a sample index, if not started, without adding a frame."""
        self.pending.setdefault(index, _Pending(self._plan.samples_per_frame))

    def lose(self, n_samples: int, n_dropped: int) -> None:
        """Shift the index of incomplete sets by the number of samples lost before them.

        Parameters
        ----------
        n_samples
            Number of samples lost.
        n_dropped
            Number of samples of complete sets that are dropped because of the loss.
        """
        self._n_lost += n_samples + n_dropped
        self.pending = {index + n_samples: found for index, found in self.pending.items()}

    def add(self, frame: PlacedFrame) -> Instant | None:
        """Store a frame in the set of its instant; return the instant if this completes it.

        Returns None otherwise, also for a frame without waveforms, and for a frame that is older
        than the newest of its message or repeats it: it is counted as refused, not stored. With
        more than `MAX_PENDING` incomplete sets, the oldest is dropped and counted as lost.

        Raises FrameError if the number of samples cannot be decoded.
        """
        part, data, index = frame
        wave = part.wave
        if wave is None or not self._is_new(wave, index, data):
            return None
        n_samples = self._plan.samples_per_frame
        if part.n_samples is not None:
            n_samples = min(n_samples, int(part.n_samples(data)))
        pending = self.pending.setdefault(index, _Pending(n_samples))
        pending.frames[wave] = data
        pending.is_spoilt |= n_samples != pending.n_samples
        if len(pending.frames) == self._plan.n_waves and not pending.is_spoilt:
            return self._finished(index, pending)
        if len(self.pending) > MAX_PENDING:
            self._n_incomplete += self.pending.pop(min(self.pending)).n_samples
        return None

    def _is_new(self, wave: int, index: int, data: bytes) -> bool:
        """Return whether a frame is newer than all others of its message; a new frame is stored."""
        seen = self._seen[wave]
        last = next(reversed(seen), -1)
        if index <= last or index < self.stop:
            self._refuse_old(seen, index, data)
            return False
        self._senders.note(contrary=False)
        seen[index] = data
        if len(seen) > _MAX_REMEMBERED:
            del seen[next(iter(seen))]
        return True

    def _refuse_old(self, seen: dict[int, bytes], index: int, data: bytes) -> None:
        """Count an old frame by reason; different data at one index show a second sender."""
        n_samples = self._plan.samples_per_frame
        near = range(index - n_samples + 1, index + n_samples)
        if seen[index] != data if index in seen else any(n in seen for n in near):
            self._refused[Refusal.CONTRADICTORY] += 1
            self._senders.note(contrary=True)
            return
        again = index == next(reversed(seen), -1)
        self._refused[Refusal.DUPLICATE if again else Refusal.OUT_OF_ORDER] += 1

    def _finished(self, index: int, complete: _Pending) -> Instant | None:
        """Return a complete instant and drop incomplete older sets, whose frames cannot arrive."""
        for earlier in [i for i in self.pending if i <= index]:
            given_up = self.pending.pop(earlier)
            self._n_incomplete += given_up.n_samples if earlier < index else 0
        if complete.n_samples == 0:
            return None
        rejected = self._rejected(index)
        self.stop = index + complete.n_samples
        frames = tuple(complete.frames[wave] for wave in range(self._plan.n_waves))
        return Instant(index, complete.n_samples, frames, rejected)

    def _rejected(self, index: int) -> dict[Refusal, int]:
        """Return the number of refused samples in the gap before an index, by reason."""
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
