"""One unit on its way along the stream, and where it resumes."""

from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

import structlog
from pydantic import TypeAdapter, ValidationError

from acquisition.clock import Clock
from core.monitor.monitor import MonitorState
from core.samples.blocks import BlockMisfitError, SampleBlock
from core.samples.gaps import Reach
from core.units import s_from_ns
from service.cluster.frames import Taken, UnitIdentity, WireError, decoded, require_possible
from service.live.live_view import LinkState, LiveView
from service.measuring.acquirer import LinkNews
from service.measuring.analyser import VERSION, Analyser, UnitMemory
from service.measuring.recorder import Findings, Recorder
from service.store.sharing import StreamPosition

_MEMORY = TypeAdapter(UnitMemory)


def written(memory: UnitMemory) -> bytes:
    """The memory as a document; floats come back to the last bit."""
    return _MEMORY.dump_json(memory)


def read(document: bytes) -> UnitMemory | None:
    """The memory that a document holds; None if it is not one of this version."""
    try:
        memory = _MEMORY.validate_json(document)
    except ValidationError:
        return None
    return memory if memory.version == VERSION else None


def memories_of(stored: Iterable[StreamPosition]) -> dict[str, UnitMemory]:
    """What is known of units, as far as it can be read."""
    found = {position.unit: read(position.memory) for position in stored}
    for unit, memory in found.items():
        if memory is None:
            log.error(
                "what was known of a unit is of another version: alarms begin anew", unit=unit
            )
    return {unit: memory for unit, memory in found.items() if memory is not None}


def usable(stored: StreamPosition | None, stream: str, newest: int) -> StreamPosition | None:
    """A stored position, if it is one on this stream as the stream is."""
    if stored is None:
        return None
    if stored.stream != stream:
        log.error("the stream was made anew: results go on with what is on it", unit=stored.unit)
        return None
    if stored.sequence > newest:
        log.error("the stream has lost what it had confirmed", unit=stored.unit)
        return None
    return stored


@dataclass(frozen=True)
class _Seen:
    sequence: int
    epoch: int | None
    stop_index: int


class Window:
    """The newest messages of a unit, by what they hold."""

    def __init__(self) -> None:
        self._seen: deque[_Seen] = deque()

    def note(self, sequence: int, block: SampleBlock, state: MonitorState) -> None:
        """Take note of a block that was taken in, and let go of what is needed no more.

        Parameters
        ----------
        state
            Behind the block; its epoch is that of the block for the analysis.
        """
        self._seen.append(_Seen(sequence, state.epoch, block.stop_index))
        while len(self._seen) > 1 and not self._is_needed(self._seen[0], state):
            self._seen.popleft()

    def first(self, otherwise: int) -> int:
        """The first message that is needed."""
        return self._seen[0].sequence if self._seen else otherwise

    @staticmethod
    def _is_needed(seen: _Seen, state: MonitorState) -> bool:
        return seen.epoch == state.epoch and seen.stop_index > state.start


log = structlog.get_logger()

MAY_ARRIVE = (LinkState.CONNECTING, LinkState.CONNECTED)
"""States in which nobody has said yet that samples do not."""


class UnitProgress:
    """Takes the messages of one unit in, in order and each once.

    Messages up to the stored position are seen once more without a word, so that the monitor holds
    what it held; from then on everything is as if it had never stopped.

    Parameters
    ----------
    stored
        How far results reach that are stored, on the same stream; None where there are none.
    memory
        What was known of the unit then.
    clock
        Of this host; how far behind a block is can be told as well as it agrees with that of the
        host that acquires.
    done
        Up to where results are stored, where it is not known which messages they are of.
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
        self._window = Window()
        self._stored = stored
        self._memory = None if stored is None else memory
        self._is_rewound = False
        self._done = done
        self._heard_s = clock.monotonic_s()
        self._why_refused: str | None = None
        self.sequence = 0
        self.behind_s = 0.0
        self.refused: Counter[str] = Counter()
        self.n_repeated = 0

    @property
    def first_needed(self) -> int:
        """First message that is wanted, at the start."""
        return 1 if self._stored is None else self._stored.window_sequence

    def reaches_back(self, first_sequence: int) -> None:
        """Hear where the stream begins now.

        What is there no more is a gap in the samples, which the monitor finds by their index.
        """
        stored = self._stored
        if stored is None or self._memory is None or self.sequence:
            return
        if first_sequence > stored.sequence + 1:
            log.error("the stream does not reach back to what is stored", unit=self.unit)
        elif first_sequence > stored.window_sequence:
            log.warning("the stream holds less than the window", unit=self.unit)

    async def take(self, sequence: int, payload: bytes) -> bool:
        """Take a message in; False if it is refused."""
        if sequence <= self.sequence:
            self._heard_s = self._clock.monotonic_s()
            self.n_repeated += 1
            return True
        try:
            message = decoded(payload, self._identity)
            if isinstance(message, Taken):
                self._require_fit(message)
        except WireError as error:
            self._refuse(sequence, error)
            self.sequence = sequence
            return False
        self._heard_s, self._why_refused = self._clock.monotonic_s(), None
        if self._stored is not None and sequence <= self._stored.sequence:
            await self._relive(sequence, message)
        elif self._is_done(message):
            self.sequence = sequence
            self.n_repeated += 1
        else:
            self._settle()
            await self._live_on(sequence, message)
        return True

    def _require_fit(self, message: Taken) -> None:
        """Refuse a block that no monitor of the unit takes, whatever its marks say."""
        require_possible(message.block)
        try:
            self._analyser.require(message.block)
        except BlockMisfitError as error:
            raise WireError("misfit", str(error)) from None

    def position(self) -> StreamPosition:
        """How far the unit is; its memory of now goes with it."""
        memory = written(self._analyser.memory(self.unit))
        first = self._window.first(self.sequence + 1)
        return StreamPosition(self.unit, self._stream, self.sequence, first, memory)

    @property
    def is_reliving(self) -> bool:
        """Whether what was taken in last is stored already."""
        return self._stored is not None and self.sequence <= self._stored.sequence

    def fall_silent(self, after_s: float, trouble: str | None = None) -> None:
        """Count the unit as lost where nothing of use has come of it for so long.

        Parameters
        ----------
        trouble
            Why nothing can come, where that is known.
        """
        if self._clock.monotonic_s() - self._heard_s <= after_s:
            return
        if self._live.status(self.unit).state in MAY_ARRIVE or self._analyser.is_connected(
            self.unit
        ):
            silence = f"no block for {after_s:g} s: is `padwatch acquire` running?"
            reason = trouble or self._why_refused or silence
            self._hear(LinkNews(self.unit, LinkState.NOT_CONNECTED, reason))

    async def _relive(self, sequence: int, message: Taken | LinkNews) -> None:
        self.sequence = sequence
        if isinstance(message, LinkNews):
            self._live.set_link(self.unit, message.state, message.reason)
            return
        self._live.set_link(self.unit, LinkState.CONNECTED)
        self._rewind(message.block)
        account = self._memory.monitor.account if self._memory else None
        await self._analyser.replay(message.block, self._sampled_s(message), account)
        self._window.note(sequence, message.block, self._analyser.state(self.unit))

    def _is_done(self, message: Taken | LinkNews) -> bool:
        """Whether the results of a block are stored; from the first on of which they are not none.

        Analysed once more they would be on another grid of segments, and be there twice.
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
        """Before the first block that is seen once more.

        Only by that it is known that samples of the window are left: news of links stay on the
        stream when blocks have gone by age, and blocks of another configuration are refused.
        """
        memory = self._memory
        if memory is None or self._is_rewound:
            return
        if block.epoch == (memory.count.reported if memory.count else memory.monitor.epoch):
            self._analyser.rewind(self.unit, memory)
            self._is_rewound = True

    def _settle(self) -> None:
        """After the last message that was seen once more; without any, as after a stop."""
        if self._memory is not None and self._is_rewound:
            self._analyser.settle(self.unit, self._memory)
        self._stored = self._memory = None

    async def _live_on(self, sequence: int, message: Taken | LinkNews) -> None:
        if isinstance(message, LinkNews):
            self._hear(message)
            self.sequence = sequence
            return
        # what was seen once more told nobody of the link, nor does a stored alarm know of it
        is_known = self._analyser.is_connected(self.unit)
        if not is_known or self._live.status(self.unit).state is not LinkState.CONNECTED:
            self._hear(LinkNews(self.unit, LinkState.CONNECTED))
        findings = await self._analyser.analyse(message.block, self._sampled_s(message))
        self.sequence = sequence
        self._window.note(sequence, message.block, self._analyser.state(self.unit))
        if findings != Findings():
            self._recorder.put(replace(findings, position=self.position()))

    def _sampled_s(self, message: Taken) -> float:
        """By this process's steady clock, where the clocks of both hosts agree."""
        self.behind_s = max(0.0, s_from_ns(self._clock.now_ns() - message.taken_ns))
        return self._clock.monotonic_s() - self.behind_s

    def _hear(self, news: LinkNews) -> None:
        if self._live.set_link(news.unit, news.state, news.reason):
            tell = log.info if news.is_connected else log.warning
            tell(news.state.value.replace("_", " "), unit=news.unit, reason=news.reason)
        self._analyser.note_link(news)

    def _refuse(self, sequence: int, error: WireError) -> None:
        self._why_refused = str(error)
        if self._stored is None or sequence > self._stored.sequence:  # else it was told then
            self._analyser.refuse(self.unit, str(error))
        if not self.refused[error.kind]:
            log.error("a message is refused", unit=self.unit, reason=str(error))
        self.refused[error.kind] += 1
