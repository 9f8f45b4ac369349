"""Assembly of admitted frames, in the order of their arrival, into raw blocks."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from acquisition.can.counters import JUMP_TOLERANCE, CounterFollower
from acquisition.can.frame_sets import (
    DuplicateSenderDetector,
    FrameSets,
    Instant,
    PlacedFrame,
)
from acquisition.can.gate import Frame
from acquisition.can.plan import Part, Plan, Refusal, RefusalCounts
from acquisition.can.side_values import RawBlockBuilder
from acquisition.delivery.arrival import LeastDelay
from acquisition.delivery.blocks import RawBlock
from acquisition.errors import FrameError
from core.samples.axis import Epochs, SampleAxis
from core.units import NS_PER_S

MAX_UNSURE_S = 1.0
"""Samples that arrive late for longer than this were not late: others before them are lost, or the
device had stopped."""

_OTHER_LOSS_S = 0.25
"""Samples that are later by so much than those before have lost others since."""

_MAX_DRIFT = 300e-6
"""Share by which a device that does not count may sample too slowly: twice what the crystals of
device and host can differ, and some."""

_WINDOW_S = 0.25
_FAST_SHARE = 0.2
_FAST_WINDOWS = 2
"""What waited before the bus was opened, and a host's clock that is put back, fill one window."""

_WIDE = 1 << 32
"""A counter of fewer samples than this may wrap while the adapter does not run."""


class FrameAssembler:
    """Assembles frames of one device into raw blocks; keeps its place across connections.

    Where messages carry counters, these show to which instant a frame belongs. Where they carry
    none, the frames of an instant come in a fixed order, and instants are counted here. In both
    cases the host's clock has to confirm complete instants. Samples that are late on their way are
    followed within a second by others that are not. Where that does not happen, a device with a
    counter has stopped, and its counter with it: a new epoch begins. Without a counter, other
    samples before or among them were lost, and none of them can be used.

    Parameters
    ----------
    begun_ns
        When this run of the adapter began, UTC; 0 where a log is read, which is the same each time.
    device_waits
        Whether the device sends when it is listened to, as one that replays a recording: then it
        is no pause if it does not.

    Attributes
    ----------
    refused
        Frames that were not used, by reason.
    n_complete
        Instants that have been complete so far, confirmed or not.
    """

    def __init__(self, plan: Plan, begun_ns: int = 0, *, device_waits: bool = False) -> None:
        self._plan, self._device_waits = plan, device_waits
        self._instant_s = plan.samples_per_frame / plan.rate_hz
        self.refused: RefusalCounts = Counter()
        is_exact = plan.reports_epoch and plan.widest_modulus >= _WIDE
        self._axis = SampleAxis(plan.rate_hz, Epochs(begun_ns, trusts_device=is_exact))
        self._senders = DuplicateSenderDetector()
        self._counters = CounterFollower(plan, self._axis, self.refused, self._senders)
        self._sets = FrameSets(plan, self.refused, self._senders)
        self._builder = RawBlockBuilder(plan)
        self._early: dict[str | int, float] = {}
        self._reported_epoch: int | None = None
        self.n_complete = 0
        self._n_fast_windows = 0
        self._begin_count()

    def _begin_count(self) -> None:
        """Forget what belongs to the epoch that has ended."""
        self._epoch = self._axis.epoch
        self._sets.begin()
        self._held: list[Instant] = []
        self._next, self._last_wave = 0, self._plan.n_waves
        self._begin_timing()
        self._builder.begin_epoch()

    def _begin_timing(self) -> None:
        self._delay = LeastDelay(JUMP_TOLERANCE.drift if self._plan.counted else _MAX_DRIFT)
        self._origin_ns: int | None = None
        self._window_s = self._early_s = 0.0
        self._late_since_s: float | None = None
        self._least_late_s = 0.0

    @property
    def trouble(self) -> str:
        """Why none of the samples can be believed; empty if they can."""
        if self._senders.found:
            return "frames contradict each other; do two devices send the same ids?"
        if not self._plan.counted and self._n_fast_windows >= _FAST_WINDOWS:
            return "more frames come than rate_hz says; do two devices send the same ids?"
        return ""

    def listen(self) -> None:
        """Note that the bus was opened: only a counter shows what passed since it was before."""
        if self._plan.counted:
            return
        if self._next > 0:
            self._axis.epochs.begin()
        self._begin_count()

    def take(
        self, frames: Iterable[Frame], arrived_ns: int, steady_ns: int | None = None
    ) -> list[RawBlock]:
        """Take the frames of a batch; return the blocks that this completes, in order.

        Parameters
        ----------
        arrived_ns
            By the host's clock, when the last of them had arrived; stamps are made of it.
        steady_ns
            The same by a clock that is never set: it shows losses, pauses and restarts. None where
            there is no other, as in a log.
        """
        passed_ns = arrived_ns if steady_ns is None else steady_ns
        blocks: list[RawBlock] = []
        for key, data in frames:
            try:
                blocks += self._take(key, data, arrived_ns, passed_ns)
            except FrameError:
                self.refused[Refusal.UNDECODABLE] += 1
        is_timed = not self._plan.counted or (steady_ns is not None and not self._device_waits)
        if self._held and (not is_timed or self._is_confirmed(passed_ns)):
            blocks += self._built(arrived_ns)
        return blocks

    def _take(
        self, key: int, data: bytes | None, arrived_ns: int, passed_ns: int
    ) -> list[RawBlock]:
        message = self._plan.messages[key]
        if data is None:
            if message.multiplexer is None and message.parts[0].wave is not None:
                self._refuse(message.parts[0].wave)
            return []
        number = int(message.multiplexer(data)) if message.multiplexer else 0
        if number not in message.parts:
            return []
        part = message.parts[number]
        if part.counter is None:
            self._note_now(part, data)
            placed = []
            if part.wave is not None:
                self._begin_set(part.wave)
                placed = [PlacedFrame(part, data, self._next)]
        else:
            placed = self._counters.place(part, data, passed_ns)
        blocks: list[RawBlock] = []
        if placed and self._axis.epoch != self._epoch:  # finish what belongs to the old epoch
            blocks = self._built(arrived_ns)
            self._begin_count()
        for frame in placed:
            if part.counter is not None:
                self._note(frame)
            instant = self._sets.add(frame, self._epoch)
            if instant is not None:
                self._held.append(instant)
                self._next = instant.stop_index
                self.n_complete += 1
        return blocks

    def _refuse(self, wave: int) -> None:
        if self._plan.counted:
            self._sets.refuse(wave)
            return
        self._begin_set(wave)
        self._sets.open(self._next)

    def _begin_set(self, wave: int) -> None:
        """Without counters, a frame that is out of turn gives up a set and begins another one."""
        if wave <= self._last_wave and self._next in self._sets.pending:
            self._next += self._plan.samples_per_frame
        self._last_wave = wave

    def _note(self, frame: PlacedFrame) -> None:
        """Note the values beside a counted frame's waveforms, for the samples it belongs to."""
        for key, value in self._early.items():
            self._builder.side.set(key, frame.first_index, value, self._plan.hold_uncounted)
        self._early.clear()
        part = frame.part
        hold = self._plan.hold_samples if part.wave is None else self._plan.samples_per_frame
        for key, read in part.values:
            self._builder.side.set(key, frame.first_index, read(frame.data), hold)

    def _note_now(self, part: Part, data: bytes) -> None:
        """Note the values of a frame without counter: they hold from now on, for a while."""
        if part.epoch is not None:
            self._note_epoch(int(part.epoch(data)))
        start: int | None = self._next
        if self._plan.counted:
            newest = self._axis.index
            start = None if newest is None else max(self._sets.stop, newest)
        for key, read in part.values:
            if start is None:
                self._early[key] = read(data)
            else:
                self._builder.side.set(key, start, read(data), self._plan.hold_uncounted)

    def _note_epoch(self, reported: int) -> None:
        """Begin another count if a device without counters reports another epoch."""
        if reported != self._reported_epoch:
            self._reported_epoch = reported
            self._axis.epochs.begin(reported)
            self._n_fast_windows = 0
            self._begin_count()

    def _is_confirmed(self, now_ns: int) -> bool:
        """Whether the clock agrees that as many samples were taken as are held."""
        late_s, now_s = self._late_s(now_ns)
        is_counted = self._plan.counted
        if late_s < (JUMP_TOLERANCE.step_s if is_counted else self._instant_s / 2):
            self._late_since_s = None
            return True
        has_grown = not is_counted and late_s > self._least_late_s + _OTHER_LOSS_S
        if self._late_since_s is None or has_grown:
            self._late_since_s, self._least_late_s = now_s, late_s
        self._least_late_s = min(self._least_late_s, late_s)
        if now_s - self._late_since_s <= MAX_UNSURE_S:
            return False
        self._late_since_s = None
        if is_counted:
            self._begin_after_pause()
        else:
            self._lose_held()
        return is_counted

    def _late_s(self, now_ns: int) -> tuple[float, float]:
        """How late the held samples are, and the time since the count began."""
        stop = self._held[-1].stop_index if self._plan.counted else self._next
        if self._origin_ns is None:
            self._origin_ns = now_ns
        now_s = (now_ns - self._origin_ns) / NS_PER_S
        late_s = self._delay.late_s(now_s - stop / self._plan.rate_hz, now_s)
        self._early_s += max(0.0, -late_s)
        passed_s = now_s - self._window_s
        if abs(passed_s) >= _WINDOW_S:
            is_fast = self._early_s > _FAST_SHARE * passed_s > 0.0
            self._n_fast_windows = self._n_fast_windows + 1 if is_fast else 0
            self._window_s, self._early_s = now_s, 0.0
        return late_s, now_s

    def _begin_after_pause(self) -> None:
        """Begin an epoch with the held samples: the device, and its counter, had stopped."""
        self._axis.epochs.begin()
        self._epoch = self._axis.epoch
        self._held = [replace(instant, epoch=self._epoch) for instant in self._held]
        self._begin_timing()

    def _lose_held(self) -> None:
        """Drop the held samples: others are missing somewhere among them."""
        n_instants = max(1, round(self._least_late_s / self._instant_s))
        n_lost = n_instants * self._plan.samples_per_frame
        n_held = sum(instant.n_samples for instant in self._held)
        n_rejected = sum(sum(instant.rejected.values()) for instant in self._held)
        self._next += n_lost
        self._sets.lose(n_lost, n_held + n_rejected)
        self._held = []

    def _built(self, arrived_ns: int) -> list[RawBlock]:
        held, self._held = self._held, []
        return self._builder.blocks(held, arrived_ns)
