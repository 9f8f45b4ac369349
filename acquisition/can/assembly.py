"""`Assembler`: from admitted frames, in the order in which they arrived, to raw blocks."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from acquisition.can.counted import CountedInstants, Placed
from acquisition.can.gate import Frame
from acquisition.can.pause import PauseCheck
from acquisition.can.plan import Instant, Part, Plan, Refusal, RefusalCounts
from acquisition.can.side_values import RawBlockBuilder
from acquisition.can.uncounted import UncountedInstants
from acquisition.delivery.raw import RawBlock
from acquisition.errors import FrameError


class Assembler:
    """Keeps its place on the sample axis across connections.

    Parameters
    ----------
    n_channels, n_slow
        Waveform and slow channels of the unit.
    hold_s
        For how long a message without counter is valid.
    begun_ns
        When this life of the adapter began, UTC; 0 where a log is read, which is the same each
        time.
    device_waits
        Whether the device sends when it is listened to, as one that replays a recording: then it
        is no pause if it does not.

    Attributes
    ----------
    refused
        Frames that were not used, by reason.
    """

    def __init__(
        self,
        plan: Plan,
        n_channels: int,
        n_slow: int,
        rate_hz: float,
        hold_s: float,
        begun_ns: int = 0,
        *,
        device_waits: bool = False,
    ) -> None:
        self._plan = plan
        self._device_waits = device_waits
        self._pause = PauseCheck(rate_hz, plan.samples_per_frame)
        self._hold = max(1, round(hold_s * rate_hz))
        self.refused: RefusalCounts = Counter()
        self._counted = CountedInstants(plan, rate_hz, self.refused, begun_ns)
        self._uncounted = UncountedInstants(plan, rate_hz, self.refused, begun_ns)
        self._builder = RawBlockBuilder(plan, n_channels, n_slow, rate_hz)
        self._early: dict[str | int, float] = {}
        self._ready: list[Instant] = []
        self._n_complete = 0
        self._epoch = self._counted.epoch

    @property
    def trouble(self) -> str:
        """Why none of the samples can be believed; empty if they can."""
        if self._counted.rivals.found:
            return "frames contradict each other; do two devices send the same ids?"
        if not self._plan.counted and self._uncounted.are_too_many:
            return "more frames come than rate_hz says; do two devices send the same ids?"
        return ""

    @property
    def n_complete(self) -> int:
        """Instants that have been complete so far, whether their place is known or not."""
        return self._n_complete + self._uncounted.n_complete

    def listen(self) -> None:
        """Note that the bus was opened: only a counter tells what passed since it was before."""
        if not self._plan.counted and self._uncounted.begin_again():
            self._builder.begin_epoch()

    def take(
        self, frames: Iterable[Frame], arrived_ns: int, steady_ns: int | None = None
    ) -> list[RawBlock]:
        """Take the frames of a batch; return the blocks that this completes, in order.

        Parameters
        ----------
        arrived_ns
            By the host's clock, when the last of them had arrived; stamps are made of it.
        steady_ns
            The same by a clock that is never set: it tells what is lost and what is a restart.
            None where there is no other, as in a log.
        """
        passed_ns = arrived_ns if steady_ns is None else steady_ns
        blocks: list[RawBlock] = []
        for key, data in frames:
            try:
                blocks += self._take(key, data, arrived_ns, passed_ns)
            except FrameError:
                self.refused[Refusal.UNDECODABLE] += 1
        if not self._plan.counted:
            self._ready = self._uncounted.confirmed(passed_ns)
        elif steady_ns is not None and not self._device_waits and self._is_late(steady_ns):
            return blocks
        return blocks + self._built(arrived_ns)

    def _is_late(self, steady_ns: int) -> bool:
        """Whether samples have to wait until it is known why they are late."""
        if self._ready and self._pause.has_paused(self._ready[-1].stop_index, steady_ns):
            self._epoch = self._counted.begin_epoch()
            self._ready = [replace(instant, epoch=self._epoch) for instant in self._ready]
        return self._pause.is_unsure

    def _take(
        self, key: int, data: bytes | None, arrived_ns: int, passed_ns: int
    ) -> list[RawBlock]:
        message = self._plan.messages[key]
        if data is None:
            if message.multiplexer is None:
                self._refuse(message.parts[0])
            return []
        number = int(message.multiplexer(data)) if message.multiplexer else 0
        if number not in message.parts:
            return []
        part = message.parts[number]
        if part.counter is not None:
            return self._take_counted(part, data, arrived_ns, passed_ns)
        self._note_now(part, data)
        if part.wave is not None:
            self._uncounted.put(part.wave, data)
        return []

    def _take_counted(
        self, part: Part, data: bytes, arrived_ns: int, passed_ns: int
    ) -> list[RawBlock]:
        if part.counter is None:
            return []
        placed = self._counted.take(part, part.counter, data, passed_ns)
        blocks = self._after_restart(self._counted.epoch, arrived_ns) if placed else []
        for frame in placed:
            self._note(frame)
            instant = self._counted.complete(frame)
            if instant is not None:
                self._n_complete += 1
                self._ready.append(instant)
        return blocks

    def _refuse(self, part: Part) -> None:
        if self._plan.counted:
            self._counted.refuse_frame(part)
        else:
            self._uncounted.refuse_frame(part)

    def _after_restart(self, epoch: int, arrived_ns: int) -> list[RawBlock]:
        """Finish what belongs to the epoch that has ended."""
        if epoch == self._epoch:
            return []
        blocks = self._built(arrived_ns)
        self._pause.begin()
        self._epoch = epoch
        self._builder.begin_epoch()
        return blocks

    def _note(self, frame: Placed) -> None:
        """Take over what a frame says beside its waveforms, for the samples it belongs to."""
        for key, value in self._early.items():
            self._builder.tracks.set(key, frame.index, value, self._hold)
        self._early.clear()
        part = frame.part
        hold = self._plan.hold_samples if part.wave is None else self._plan.samples_per_frame
        for key, read in part.values:
            self._builder.tracks.set(key, frame.index, read(frame.data), hold)

    def _note_now(self, part: Part, data: bytes) -> None:
        """Take over what a message without counter says: it holds from now on, for a while."""
        if part.epoch is not None and self._uncounted.set_epoch(int(part.epoch(data))):
            self._builder.begin_epoch()
        start = self._counted.now if self._plan.counted else self._uncounted.next_index
        for key, read in part.values:
            if start is None:
                self._early[key] = read(data)
            else:
                self._builder.tracks.set(key, start, read(data), self._hold)

    def _built(self, arrived_ns: int) -> list[RawBlock]:
        ready, self._ready = self._ready, []
        return self._builder.blocks(ready, arrived_ns)
