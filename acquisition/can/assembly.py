"""Assembly of admitted CAN frames, in order of arrival, to sample blocks."""

from collections import Counter
from collections.abc import Iterable

from acquisition.can.counters import JUMP_TOLERANCE, CounterFollower
from acquisition.can.frame_sets import (
    DuplicateSenderDetector,
    FrameSets,
    Instant,
    PlacedFrame,
)
from acquisition.can.gate import Frame
from acquisition.can.plan import Part, Plan, Refusal, RefusalCounts
from acquisition.can.side_values import BlockBuilder
from acquisition.delivery.arrival import LeastDelay
from acquisition.errors import FrameError
from core.samples.axis import Epochs, SampleAxis
from core.samples.blocks import SampleBlock
from core.units import NS_PER_S

MAX_UNSURE_S = 1.0
"""Longest time, s, for which samples may stay late by the host's clock. A longer delay shows that
other samples were lost, or that the device had stopped."""

_OTHER_LOSS_S = 0.25
"""Increase of the delay, s, that shows a further loss of samples."""

_MAX_DRIFT = 300e-6
"""Relative error by which the rate of a device without counter may be too low: more than twice
the largest difference of the crystals of device and host."""

_WINDOW_S = 0.25
_FAST_SHARE = 0.2
_FAST_WINDOWS = 2
"""Successive windows with too many frames that show a fault; a clock step causes only one."""

_WIDE = 1 << 32
"""Smallest modulus of a counter, in samples, that does not wrap while the program is stopped."""


class FrameAssembler:
    """Assembler of the frames of one device; keeps its sample index across connections.

    A sample instant is the set of frames, one per waveform message, with the same sample index. The
    counter in a message determines the instant of its frame. Without counters, the frames of an
    instant arrive in a fixed order, and instants are counted by the host. In both cases complete
    instants must be confirmed by the host's clock: delayed samples catch up with it within a
    second. If they do not, a device with a counter has paused sampling, and a new epoch begins.
    Without a counter, samples were lost, and all unconfirmed samples are dropped.

    Parameters
    ----------
    begun_ns
        Start time of this source, UTC ns since 1970; 0 for a log file, for reproducible epochs.
    device_waits
        Whether the device sends only while the host listens, for example in a replay; its pauses
        then do not start a new epoch.

    Attributes
    ----------
    refused
        Number of refused frames by reason.
    n_complete
        Number of complete instants so far, confirmed or not.
    """

    def __init__(self, plan: Plan, begun_ns: int = 0, *, device_waits: bool = False) -> None:
        self._plan, self._device_waits = plan, device_waits
        self._instant_s = plan.samples_per_frame / plan.rate_hz
        self.refused: RefusalCounts = Counter()
        is_exact = plan.reports_epoch and plan.widest_modulus >= _WIDE
        self._axis = SampleAxis(plan.rate_hz, Epochs(begun_ns, trusts_device=is_exact))
        self._senders = DuplicateSenderDetector()
        self._counters = CounterFollower(plan, self._axis, self.refused, self._senders)
        self._builder = BlockBuilder(plan)
        self._early: dict[str | int, float] = {}
        self._reported_epoch: int | None = None
        self.n_complete = 0
        self._n_fast_windows = 0
        self._begin_count()

    def _begin_count(self) -> None:
        """Drop incomplete and unconfirmed samples and side values, at the start of a new epoch."""
        self._epoch = self._axis.epoch
        self._sets = FrameSets(self._plan, self.refused, self._senders)
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
        """Reason why all samples are refused, in words; empty if they are valid."""
        if self._senders.found:
            return "frames contradict each other; do two devices send the same CAN ids?"
        if not self._plan.counted and self._n_fast_windows >= _FAST_WINDOWS:
            return "frames arrive faster than rate_hz; do two devices send the same CAN ids?"
        return ""

    def listen(self) -> None:
        """Record that the bus was opened; without counters, a new epoch starts."""
        if self._plan.counted:
            return
        if self._next > 0:
            self._axis.epochs.begin()
        self._begin_count()

    def take(
        self, frames: Iterable[Frame], arrived_ns: int, steady_ns: int | None = None
    ) -> list[SampleBlock]:
        """Add the frames of a batch; return the completed blocks in order.

        Parameters
        ----------
        arrived_ns
            Arrival of the last frame by the host's UTC clock, ns; source of time stamps.
        steady_ns
            Arrival by the monotonic clock, ns, to detect losses, pauses and restarts; None for a
            log file, which has UTC times only.
        """
        passed_ns = arrived_ns if steady_ns is None else steady_ns
        blocks: list[SampleBlock] = []
        for key, data in frames:
            try:
                blocks += self._take(key, data, arrived_ns, passed_ns)
            except FrameError:
                self.refused[Refusal.UNDECODABLE] += 1
            if self._senders.found:  # also what is held since before the detection may be mixed
                blocks, self._held = [], []
        is_timed = not self._plan.counted or (steady_ns is not None and not self._device_waits)
        if self._held and (not is_timed or self._is_confirmed(passed_ns)):
            blocks += self._built(arrived_ns)
        return blocks

    def _take(
        self, key: int, data: bytes | None, arrived_ns: int, passed_ns: int
    ) -> list[SampleBlock]:
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
        blocks: list[SampleBlock] = []
        if placed and self._axis.epoch != self._epoch:  # complete the blocks of the old epoch
            blocks = self._built(arrived_ns)
            self._begin_count()
        for frame in placed:
            if part.counter is not None:
                self._note(frame)
            instant = self._sets.add(frame)
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
        """Without counters, start the next set at a frame out of order; abandon the current set."""
        if wave <= self._last_wave and self._next in self._sets.pending:
            self._next += self._plan.samples_per_frame
        self._last_wave = wave

    def _note(self, frame: PlacedFrame) -> None:
        """Store the side values of a frame with counter for the samples of this frame."""
        for key, value in self._early.items():
            self._builder.side.set(key, frame.first_index, value, self._plan.hold_uncounted)
        self._early.clear()
        part = frame.part
        hold = self._plan.hold_samples if part.wave is None else self._plan.samples_per_frame
        for key, read in part.values:
            self._builder.side.set(key, frame.first_index, read(frame.data), hold)

    def _note_now(self, part: Part, data: bytes) -> None:
        """Store the side values of a frame without counter; valid for `hold_s` from now."""
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
        """Start a new epoch if a device without counters reports a changed epoch."""
        if reported != self._reported_epoch:
            self._reported_epoch = reported
            self._axis.epochs.begin(reported)
            self._n_fast_windows = 0
            self._begin_count()

    def _is_confirmed(self, now_ns: int) -> bool:
        """Return whether the host's clock confirms the number of held samples."""
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
        """Return the delay of the held samples and the time since the start of the count, s."""
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
        """Start a new epoch with the held samples, after the device had paused sampling."""
        self._axis.epochs.begin()
        self._epoch = self._axis.epoch
        self._begin_timing()

    def _lose_held(self) -> None:
        """Drop the held samples, because samples were lost at an unknown place among them."""
        n_instants = max(1, round(self._least_late_s / self._instant_s))
        n_lost = n_instants * self._plan.samples_per_frame
        n_held = sum(instant.n_samples for instant in self._held)
        n_rejected = sum(sum(instant.rejected.values()) for instant in self._held)
        self._next += n_lost
        self._sets.lose(n_lost, n_held + n_rejected)
        self._held = []

    def _built(self, arrived_ns: int) -> list[SampleBlock]:
        held, self._held = self._held, []
        return self._builder.blocks(self._epoch, held, arrived_ns)
