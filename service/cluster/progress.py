"""Processing of the stream messages of a unit, and its resumption after a restart."""

from collections import Counter, deque
from collections.abc import Iterable
from contextlib import suppress

import structlog
from pydantic import TypeAdapter, ValidationError

from acquisition.clock import Clock
from core.samples.blocks import BlockMisfitError, SampleBlock
from core.samples.gaps import Reach
from core.units import s_from_ns
from service.cluster.frames import Taken, UnitIdentity, WireError, decoded, require_possible
from service.live.status import LinkState
from service.measuring.acquirer import LinkNews
from service.measuring.analyser import VERSION, Analyser, UnitMemory
from service.measuring.live_view import LiveView
from service.measuring.recorder import Recorder
from service.store.sharing import StreamPosition

log = structlog.get_logger()

_MEMORY = TypeAdapter(UnitMemory)


def memories_of(stored: Iterable[StreamPosition]) -> dict[str, UnitMemory]:
    """Return the stored analysis states by unit id; log and omit states that are not readable."""
    memories = {}
    for position in stored:
        memory = None
        with suppress(ValidationError):
            memory = _MEMORY.validate_json(position.memory)
        if memory is not None and memory.version == VERSION:
            memories[position.unit] = memory
        else:
            log.error(
                "stored analysis state cannot be read; the analysis restarts without it",
                unit=position.unit,
            )
    return memories


def usable(stored: StreamPosition | None, stream: str, newest: int) -> StreamPosition | None:
    """Return a stored position if it is valid on this stream; otherwise log why and return None.

    ``stream`` is the stream's name with creation time, ``newest`` its newest sequence number.
    """
    if stored is None:
        return None
    if stored.stream != stream:
        log.error("the stream was replaced: the stored position is discarded", unit=stored.unit)
        return None
    if stored.sequence > newest:
        log.error(
            "the stream has lost confirmed messages; check the servers' disks", unit=stored.unit
        )
        return None
    return stored


MAY_ARRIVE = (LinkState.CONNECTING, LinkState.CONNECTED)
"""Link states in which samples may arrive."""


def take_news(news: LinkNews, live: LiveView, analyser: Analyser) -> None:
    """Update the link state of a unit and its alarm; log a change."""
    if live.set_link(news.unit, news.state, news.reason):
        write = log.info if news.is_connected else log.warning
        write(news.state.value.replace("_", " "), unit=news.unit, reason=news.reason)
    analyser.note_link(news)


class UnitProgress:
    """Processor of the stream messages of one unit: each is processed once, in order.

    Messages up to the stored position are replayed without publishing results, which restores the
    state of the monitor. Later messages are processed as if the process had never stopped.

    Parameters
    ----------
    stored
        Position of the stored results on the same stream; None without stored results.
    memory
        Analysis state of the unit at the stored position.
    clock
        Clock of this host. A difference from the clock of the acquiring host is an error of the
        measured delays of blocks.
    done
        Epoch, sample index and time at which the stored results end, if their position on the
        stream is unknown; otherwise None.
    """

    def __init__(
        self,
        identity: UnitIdentity,
        stream: str,
        stored: StreamPosition | None,
        memory: UnitMemory | None,
        analyser: Analyser,
        live: LiveView,
        recorder: Recorder,
        clock: Clock,
        done: Reach | None = None,
    ) -> None:
        self._clock = clock
        self.unit, self._identity, self._stream = identity.unit, identity, stream
        self._analyser, self._live, self._recorder = analyser, live, recorder
        self._monitor = analyser.monitors[identity.unit]
        # sequence number, epoch and stop index of the messages with which a replay begins
        self._window: deque[tuple[int, int | None, int]] = deque()
        self._stored = stored
        self._memory = None if stored is None else memory
        self._is_rewound = False
        self._done = done
        self._arrived_s = clock.monotonic_s()
        self._why_refused: str | None = None
        self.sequence = 0
        self.behind_s = 0.0
        self.refused: Counter[str] = Counter()
        self.n_repeated = 0

    @property
    def first_needed(self) -> int:
        """Sequence number of the oldest message that is needed after a start."""
        return 1 if self._stored is None else self._stored.window_sequence

    def reaches_back(self, first_sequence: int) -> None:
        """Log a warning if needed messages before ``first_sequence`` are no longer on the stream.

        Missing messages are a gap in the samples, which the monitor detects by the sample index.
        """
        stored = self._stored
        if stored is None or self._memory is None or self.sequence:
            return
        if first_sequence > stored.sequence + 1:
            log.error(
                "the stream begins after the stored results, so samples are missing; raise"
                " [stream] max_age_h in the plant file",
                unit=self.unit,
            )
        elif first_sequence > stored.window_sequence:
            log.warning(
                "the stream no longer has all samples of the averaging window", unit=self.unit
            )

    async def take(self, sequence: int, payload: bytes) -> bool:
        """Process the message `payload` with its sequence number; return False if it is unusable.

        A message that was processed before is only counted as repeated.
        """
        if sequence <= self.sequence:
            self._arrived_s = self._clock.monotonic_s()
            self.n_repeated += 1
            return True
        try:
            message = decoded(payload, self._identity)
            if isinstance(message, Taken):
                require_possible(message.block)
                self._monitor.require(message.block)
        except (WireError, BlockMisfitError) as error:
            self._refuse(sequence, error)
            self.sequence = sequence
            return False
        self._arrived_s, self._why_refused = self._clock.monotonic_s(), None
        if self._stored is not None and sequence <= self._stored.sequence:
            await self._replay(sequence, message)
        elif self._is_done(message):
            self.sequence = sequence
            self.n_repeated += 1
        else:
            self._commit()
            await self._process(sequence, message)
        return True

    def position(self) -> StreamPosition:
        """Return the stream position of the unit, with its present analysis state."""
        memory = _MEMORY.dump_json(self._analyser.memory(self.unit))
        first = self._window[0][0] if self._window else self.sequence + 1
        return StreamPosition(self.unit, self._stream, self.sequence, first, memory)

    @property
    def is_replaying(self) -> bool:
        """Whether the newest processed message is at or before the stored position."""
        return self._stored is not None and self.sequence <= self._stored.sequence

    def fall_silent(self, after_s: float, trouble: str | None = None) -> None:
        """Mark the unit as not connected if no usable message arrived for ``after_s`` seconds.

        ``trouble`` is the reason why no messages arrive; None if it is unknown.
        """
        if self._clock.monotonic_s() - self._arrived_s <= after_s:
            return
        is_connected = self._analyser.alarms.units[self.unit].is_connected
        if is_connected or self._live.status(self.unit).state in MAY_ARRIVE:
            silence = f"no block for {after_s:g} s; check that `padwatch acquire` is running"
            reason = trouble or self._why_refused or silence
            take_news(
                LinkNews(self.unit, LinkState.NOT_CONNECTED, reason), self._live, self._analyser
            )

    async def _replay(self, sequence: int, message: Taken | LinkNews) -> None:
        self.sequence = sequence
        if isinstance(message, LinkNews):
            self._live.set_link(self.unit, message.state, message.reason)
            return
        self._live.set_link(self.unit, LinkState.CONNECTED)
        self._rewind(message.block)
        account = self._memory.monitor.account if self._memory else None
        await self._analyser.replay(message.block, self._sampled_s(message), account)
        self._note(sequence, message.block)

    def _is_done(self, message: Taken | LinkNews) -> bool:
        """Return whether a message contains a block whose results are already stored.

        After the first new block the result is always False. A second analysis, with differently
        placed segments, would store results twice.
        """
        if self._done is None or isinstance(message, LinkNews):
            return False
        block, done = message.block, self._done
        if block.epoch == done.epoch:
            is_done = block.stop_index <= done.stop_index
        else:
            is_done = block.stop_ns <= done.stop_ns
        if not is_done:
            self._done = None
        return is_done

    def _rewind(self, block: SampleBlock) -> None:
        """Restore the stored state before the first replayed block.

        Only a block shows that the stream still has samples of the window: link states may stay on
        the stream longer than blocks, and blocks of another configuration are refused.
        """
        memory = self._memory
        if memory is None or self._is_rewound:
            return
        if block.epoch == (memory.count.reported if memory.count else memory.monitor.epoch):
            self._analyser.rewind(self.unit, memory)
            self._is_rewound = True

    def _commit(self) -> None:
        """End the replay; if no block was replayed, the monitor starts without a restored state."""
        if self._memory is not None and self._is_rewound:
            self._monitor.settle(self._memory.monitor)
        self._stored = self._memory = None

    async def _process(self, sequence: int, message: Taken | LinkNews) -> None:
        if isinstance(message, LinkNews):
            take_news(message, self._live, self._analyser)
            self.sequence = sequence
            return
        # the link state is not yet known from the replay or from a stored alarm
        is_known = self._analyser.alarms.units[self.unit].is_connected
        if not is_known or self._live.status(self.unit).state is not LinkState.CONNECTED:
            connected = LinkNews(self.unit, LinkState.CONNECTED)
            take_news(connected, self._live, self._analyser)
        findings = await self._analyser.analyse(message.block, self._sampled_s(message))
        self.sequence = sequence
        self._note(sequence, message.block)
        if findings:
            self._recorder.put([*findings, self.position()])

    def _note(self, sequence: int, block: SampleBlock) -> None:
        """Add a message to the window of the messages that restore the state by a replay."""
        state = self._monitor.state
        self._window.append((sequence, state.epoch, block.stop_index))
        while len(self._window) > 1:
            _, epoch, stop_index = self._window[0]
            if epoch == state.epoch and stop_index > state.start:
                return
            self._window.popleft()

    def _sampled_s(self, message: Taken) -> float:
        """Return the monotonic time of the last sample, s; exact if both hosts' clocks agree."""
        self.behind_s = max(0.0, s_from_ns(self._clock.now_ns() - message.taken_ns))
        return self._clock.monotonic_s() - self.behind_s

    def _refuse(self, sequence: int, error: WireError | BlockMisfitError) -> None:
        self._why_refused = str(error)
        # a message up to the stored position was already reported before the restart
        if self._stored is None or sequence > self._stored.sequence:
            self._analyser.alarms.refuse(self.unit, str(error))
        kind = error.kind if isinstance(error, WireError) else "misfit"
        if not self.refused[kind]:
            log.error("a message is rejected", unit=self.unit, reason=str(error))
        self.refused[kind] += 1
