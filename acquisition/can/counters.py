"""Sample index of frames with counters; a counter jump must be confirmed by a second frame."""

from collections.abc import Sequence
from typing import NamedTuple

from acquisition.can.frame_sets import DuplicateSenderDetector, PlacedFrame
from acquisition.can.plan import Part, Plan, Refusal, RefusalCounts
from core.samples.axis import ClockTolerance, SampleAxis, signed_distance
from core.units import NS_PER_S

_NEAR_FRAMES = 64
"""Distance in frames beyond which a counter jump must be confirmed by a second frame."""

_SILENCE_S = 1.0
"""Silence, s, after which the first frame must also be confirmed; the device may have restarted."""

JUMP_TOLERANCE = ClockTolerance(step_s=0.5, drift=0.05)
"""Largest difference between the host's clock and a counter that has wrapped or fallen behind; a
larger one is a restart or a pause of the device. The drift allows for a wrong sampling rate."""


class _CountedFrame(NamedTuple):
    """Frame with its counter in samples, 0 to ``part.modulus - 1``."""

    part: Part
    data: bytes
    counter: int
    epoch: int | None
    arrived_ns: int


class CounterFollower:
    """Converter of frame counters of any width to sample indices on one axis.

    A frame close to the newest frame gets its sample index at once. A frame farther away is held
    until a second frame confirms it. The jump is a gap if the device reports no new epoch and the
    counter increased, or the jump matches the clock, or the device reports epochs but these frames
    have none or the counter wrapped by at most half its period. Otherwise the device has restarted
    its counter, and a new epoch begins.

    Parameters
    ----------
    plan
        Decoding plan, with the sampling rate and the widest counter.
    axis
        Sample axis, at the first sample of the newest frame.
    refused
        Counts of refused frames; updated in place.
    senders
        Detector of a second sender of the frames; updated in place.
    """

    def __init__(
        self,
        plan: Plan,
        axis: SampleAxis,
        refused: RefusalCounts,
        senders: DuplicateSenderDetector,
    ) -> None:
        self._plan, self._axis, self._rate_hz = plan, axis, plan.rate_hz
        self._near_samples = _NEAR_FRAMES * plan.samples_per_frame
        self._refused, self._senders = refused, senders
        self._epoch: int | None = None
        self._doubted: list[_CountedFrame] = []
        self._left: tuple[int, int, int, int | None] | None = None

    def place(self, part: Part, data: bytes, arrived_ns: int) -> list[PlacedFrame]:
        """Add a frame of `part`; return the frames whose sample index it determines.

        These are the frame itself, and earlier frames that it confirms; possibly none.

        `arrived_ns` is the arrival by the host's monotonic clock.
        """
        if part.counter is None:
            return []
        epoch = int(part.epoch(data)) if part.epoch else None
        frame = _CountedFrame(part, data, int(part.counter(data)), epoch, arrived_ns)
        if self._axis.index is None:
            return self._first(frame)
        if self._doubted and self._confirms(frame):
            return self._jump([*self._doubted, frame])
        for _ in self._doubted:
            self._refused[Refusal.IMPOSSIBLE_COUNTER] += 1
            self._senders.note(contrary=True)
        self._doubted.clear()
        index = self._near_index(frame) if epoch in (None, self._epoch) else None
        if index is None:
            self._doubted.append(frame)
            return []
        return [PlacedFrame(part, data, index)]

    def _first(self, frame: _CountedFrame) -> list[PlacedFrame]:
        if frame.part.modulus < self._plan.widest_modulus:
            self._refused[Refusal.BEFORE_START] += 1
            return []
        if frame.epoch is not None:
            self._epoch = frame.epoch
            self._axis.epochs.begin_first(frame.epoch)
        self._axis.stand_at(frame.counter, frame.arrived_ns)
        return [PlacedFrame(frame.part, frame.data, frame.counter)]

    def _near_index(self, frame: _CountedFrame) -> int | None:
        """Return the sample index of a frame close to the newest frame; None for other frames."""
        axis, newest, modulus = self._axis, self._axis.index or 0, frame.part.modulus
        half = modulus // 2
        if axis.elapsed(frame.arrived_ns) > min(_SILENCE_S * self._rate_hz, half):
            return None
        ahead = axis.forward(frame.counter, modulus)
        if ahead <= min(self._near_samples, half):
            axis.stand_at(newest + ahead, frame.arrived_ns)
            return newest + ahead
        behind = modulus - ahead
        return newest - behind if behind <= min(self._near_samples, half // 2) else None

    def _confirms(self, frame: _CountedFrame) -> bool:
        """Return whether a frame confirms the last held frame by following it closely."""
        last = self._doubted[-1]
        repeats = last.part is frame.part and last.counter == frame.counter
        if repeats or (frame.epoch is not None and frame.epoch != self._epoch_of(self._doubted)):
            return False
        modulus = min(last.part.modulus, frame.part.modulus)
        ahead = (frame.counter - last.counter) % modulus
        return ahead <= min(self._near_samples, modulus // 2)

    def _epoch_of(self, frames: Sequence[_CountedFrame]) -> int | None:
        reported = [frame.epoch for frame in frames if frame.epoch is not None]
        return reported[-1] if reported else self._epoch

    def _jump(self, frames: Sequence[_CountedFrame]) -> list[PlacedFrame]:
        """Continue at the counter of frames that confirm each other, after a gap or a restart."""
        self._doubted = []
        axis, epoch = self._axis, self._epoch_of(frames)
        widest = max(frames, key=lambda frame: frame.part.modulus)
        modulus = widest.part.modulus
        left = (axis.index or 0, modulus, axis.at_ns, self._epoch)
        if epoch == self._epoch and self._is_gap(frames, widest):
            index = (axis.index or 0) + axis.jump(widest.counter, modulus, widest.arrived_ns)
        else:
            axis.epochs.begin(epoch if epoch != self._epoch else None)
            index = widest.counter
            if self._resumes(widest, epoch):
                self._senders.note_return()
        self._left, self._epoch = left, epoch
        axis.stand_at(index, widest.arrived_ns)
        return [PlacedFrame(f.part, f.data, self._nearest(f, index)) for f in frames]

    def _is_gap(self, frames: Sequence[_CountedFrame], widest: _CountedFrame) -> bool:
        """Return whether a jump is a gap in the same count rather than a restart of the counter."""
        axis, reports = self._axis, self._plan.reports_epoch
        if reports and all(frame.epoch is None for frame in frames):
            return True
        counter, modulus, at_ns = widest.counter, widest.part.modulus, widest.arrived_ns
        if counter >= (axis.index or 0) % modulus:
            return True
        if reports and axis.forward(counter, modulus) <= modulus // 2:
            return True
        deviation = axis.jump(counter, modulus, at_ns) - axis.elapsed(at_ns)
        return abs(deviation) <= axis.allowance(at_ns, JUMP_TOLERANCE)

    def _resumes(self, frame: _CountedFrame, epoch: int | None) -> bool:
        """Return whether a frame continues the previous count, ended within the last second."""
        if self._left is None:
            return False
        index, modulus, left_ns, left_epoch = self._left
        silent_s = (frame.arrived_ns - left_ns) / NS_PER_S
        ahead = (frame.counter - index) % modulus
        is_same = left_epoch == epoch and modulus == frame.part.modulus
        return (
            is_same
            and silent_s <= _SILENCE_S
            and 0 < ahead <= self._near_samples + silent_s * self._rate_hz
        )

    def _nearest(self, frame: _CountedFrame, index: int) -> int:
        place = index + signed_distance(frame.counter, index, frame.part.modulus)
        self._axis.stand_at(max(self._axis.index or 0, place), frame.arrived_ns)
        return place
