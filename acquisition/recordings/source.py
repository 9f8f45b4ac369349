"""`RecordingSource`: finite source of samples that replays a recording or selected channels."""

import itertools
from collections.abc import AsyncGenerator, AsyncIterator, Iterable, Iterator, Mapping
from contextlib import aclosing, asynccontextmanager, closing
from dataclasses import dataclass, replace

import numpy as np

from acquisition.clock import Clock
from acquisition.delivery.blocks import MIN_BLOCK_S, BlockAssembler
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import RecordedUnit
from acquisition.recordings.reader import Recording
from core.machine.unit import Unit
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration


@dataclass(frozen=True)
class Selection:
    """Selected channels of a recording in the order that a unit needs, with their calibration.

    Parameters
    ----------
    channels
        Indices of the selected waveform channels in the recording.
    slow
        Indices of the selected slow channels in the recording.
    calibration
        Calibration of the selected channels, which replaces that of the recording.
    """

    channels: tuple[int, ...]
    slow: tuple[int, ...]
    calibration: UnitCalibration

    def of(self, block: SampleBlock) -> SampleBlock:
        """Return a recorded block reduced to the selected channels."""
        side, rows = block.side, list(self.channels)
        selected = replace(side, ok=side.ok[rows], slow=side.slow[list(self.slow)])
        counts = block.counts[rows]
        return replace(block, calibration=self.calibration, counts=counts, side=selected)


def all_of(recorded: RecordedUnit) -> Selection:
    """Return the selection of all channels, with the recorded calibration."""
    n_channels, n_slow = len(recorded.channels), len(recorded.slow_channels)
    return Selection(tuple(range(n_channels)), tuple(range(n_slow)), recorded.calibration)


def select(recorded: RecordedUnit, unit: Unit, slow_units: Mapping[str, str]) -> Selection:
    """Return the selection of a unit's channels from a recording, with their recorded calibration.

    Parameters
    ----------
    slow_units
        Unit of measurement of each requested slow channel, by channel id, in the order requested.

    Raises
    ------
    ConfigError
        If rates or units of measurement differ (the message states both), or a channel is missing.
    """
    if recorded.rate_hz != unit.rate_hz:
        raise ConfigError(
            f"the recording has a sampling rate of {recorded.rate_hz:.9g} Hz, but unit {unit.id}"
            f" of {unit.rate_hz:.9g} Hz"
        )
    measurands = {c.id: c.measurand.value for c in recorded.channels}
    units = {c.id: c.unit for c in recorded.slow_channels}
    wanted = {c.id: c.measurand.value for c in unit.channels}
    channels = _positions(measurands, wanted, f"unit {unit.id}", "channel")
    slow = _positions(units, slow_units, f"unit {unit.id}", "slow channel")
    calibration = recorded.calibration
    return Selection(
        channels,
        slow,
        replace(
            calibration,
            unit=unit.id,
            channels=tuple(calibration.channels[n] for n in channels),
            slow=tuple(calibration.slow[n] for n in slow),
        ),
    )


def _positions(
    recorded: Mapping[str, str], wanted: Mapping[str, str], owner: str, kind: str
) -> tuple[int, ...]:
    missing = [id_ for id_ in wanted if id_ not in recorded]
    if missing:
        raise ConfigError(
            f"{owner} requires {kind} {_listed(missing)}, but the recording has {_listed(recorded)}"
        )
    for id_, unit in wanted.items():
        if recorded[id_] != unit:
            raise ConfigError(
                f"{kind} {id_} is recorded as {recorded[id_]}, but configured as {unit} in {owner}"
            )
    ids = list(recorded)
    return tuple(ids.index(id_) for id_ in wanted)


def _listed(ids: Iterable[str]) -> str:
    return ", ".join(ids) or "none"


class RecordingSource:
    """Source of the calibrated blocks of a recording, paced by a clock or as fast as possible.

    A paced recording runs from the first connection on: samples due without a connection are
    lost, and the sample index jumps. Without pacing, a new connection continues at the block after
    the last one delivered. Gaps within an epoch take their recorded duration. The duration of a
    device restart is unknown; it takes no time.

    Parameters
    ----------
    selection
        Channels and their calibration; by default all channels as recorded.
    speed
        Seconds of the recording per second of the clock; None without pacing.
    block_s
        Length of the blocks in seconds; blocks before a gap may be shorter.

    Raises
    ------
    ValueError
        If the speed is not positive.
    """

    def __init__(
        self,
        recording: Recording,
        clock: Clock,
        selection: Selection | None = None,
        speed: float | None = None,
        block_s: float = MIN_BLOCK_S,
    ) -> None:
        if speed is not None and not speed > 0.0:
            raise ValueError(f"speed must be above 0, got {speed}")
        self._recording = recording
        self._clock = clock
        self._selection = selection or all_of(recording.manifest)
        self._delivery = BlockAssembler(self._selection.calibration)
        self._speed = speed
        self._block_samples = max(1, round(block_s * recording.manifest.rate_hz))
        self._start_s: float | None = None
        self._next_block = self._n_passed = 0
        self._stop = (-1, 0)

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        """Start or continue the replay, and yield an iterator of its sample blocks.

        Iteration raises ConfigError if a file of the recording has become unreadable.
        """
        if self._start_s is None:
            self._start_s = self._clock.monotonic_s()
        async with aclosing(self._blocks(self._elapsed_s())) as blocks:
            yield blocks

    async def _blocks(self, missed_s: float) -> AsyncGenerator[SampleBlock]:
        with closing(self._recording.blocks(self._next_block)) as recorded:
            for piece in (piece for block in recorded for piece in self._pieces(block)):
                epoch, stop_index = self._stop
                n_gap = max(0, piece.first_index - stop_index) if piece.epoch == epoch else 0
                n_passed = self._n_passed + n_gap + piece.n_samples
                due_s = n_passed / piece.rate_hz / self._speed if self._speed else 0.0
                missed = 0.0 < due_s <= missed_s
                await self._clock.sleep(0.0 if missed else max(0.0, due_s - self._elapsed_s()))
                self._n_passed, self._stop = n_passed, (piece.epoch, piece.stop_index)
                self._next_block += piece.side.n_cells
                if not missed:
                    for block in self._delivery.take([self._selection.of(piece)]):
                        yield block
            for block in self._delivery.flush():
                yield block

    def _pieces(self, block: SampleBlock) -> Iterator[SampleBlock]:
        """Yield a block split at its cells into pieces of about the block length."""
        starts = block.side.starts
        stretch = (block.first_index + starts) // self._block_samples
        cuts = starts[1:][np.diff(stretch) > 0].tolist()
        for start, stop in itertools.pairwise([0, *cuts, block.n_samples]):
            yield block.from_sample(start, stop)

    def _elapsed_s(self) -> float:
        return self._clock.monotonic_s() - (self._start_s or 0.0)
