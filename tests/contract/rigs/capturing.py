"""Captures, fed block by block."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.recordings.manifest import RecordedChannel, RecordedUnit
from acquisition.recordings.reader import Recording, open_recording
from acquisition.recordings.writer import RecordingWriter
from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.life_cycle import update
from core.alarms.operation import Shelve, operate
from core.limits import AlarmLevel, Judgement
from core.machine.channel import Measurand
from core.quality import GOOD, Reason, bad
from core.samples.blocks import SampleBlock
from rigs.blocks import given_block
from rigs.standing_clock import StandingClock
from service.recordings.around_alarms import Captures, CaptureSettings

RATE_HZ = 50.0
BLOCK = 10
"""A fifth of a second."""

T0 = 1_767_225_600_000_000_000
SECOND = 1_000_000_000
SETTINGS = CaptureSettings(pre_s=3.0, post_s=5.0, max_s=12.0)
ALERT = Judgement(AlarmLevel.ALERT, value=160.0, limit=150.0, reason="above_limit")


def recorded_unit(unit: str) -> RecordedUnit:
    """Two channels."""
    limits = {"full_scale_v": 10.0, "unit_per_v": 1e7, "ok_min_v": -10.0, "ok_max_v": 10.0}
    channels = tuple(
        RecordedChannel(id=id_, measurand=Measurand.DISPLACEMENT_UM, **limits) for id_ in "ab"
    )
    return RecordedUnit(
        unit=unit,
        rate_hz=RATE_HZ,
        channels=channels,
        slow_channels=(),
        sample_type="float32",
        block_samples=BLOCK,
    )


def block(
    number: int,
    unit: str = "U1",
    lost: bool = False,
    start_ns: int | None = None,
    epoch: int = 1,
    by: float = 0.0,
) -> SampleBlock:
    """Block of a fifth of a second; channel a is the number of the sample, plus `by`."""
    first = number * BLOCK
    index = np.arange(first, first + BLOCK, dtype=np.float32) + np.float32(by)
    return given_block(
        unit=unit,
        epoch=epoch,
        first_index=first,
        start_ns=T0 + number * SECOND // 5 if start_ns is None else start_ns,
        rate_hz=RATE_HZ,
        samples=np.array([index, -index]),
        channel_quality=(bad(Reason.SENSOR_FAILURE) if lost else GOOD, GOOD),
        calibration=recorded_unit(unit).calibration,
    )


def counted_unit(unit: str) -> RecordedUnit:
    """The same unit with a device that delivers counts, one for each unit of displacement."""
    limits = {"full_scale_v": 32768.0, "unit_per_v": 1.0, "ok_min_v": -4e4, "ok_max_v": 4e4}
    found = recorded_unit(unit)
    channels = tuple(channel.model_copy(update=limits) for channel in found.channels)
    return found.model_copy(update={"channels": channels, "sample_type": "int16"})


def counted_block(number: int, unit: str = "U1", by: float = 0.0, **how: Any) -> SampleBlock:
    """The same block as counts; where they are off by a fraction, as engineering units."""
    found = block(number, unit, by=by, **how)
    counts = found.counts if by else found.counts.astype(np.int16)
    return replace(found, counts=counts, calibration=counted_unit(unit).calibration)


def raised(
    at_s: float, kind: str = "order1_shaft_x", unit: str = "U1", shelved: bool = False
) -> AlarmNews:
    """An alarm that is raised so many seconds after the start."""
    alarm = Alarm(AlarmIdentity(unit, "UJB", kind))
    if shelved:
        alarm, _ = operate(alarm, Shelve("A. Name", "known", T0 + 10**15), T0)
    return AlarmNews(*update(alarm, ALERT, T0 + round(at_s * SECOND), AlarmRule()))


class Rig:
    """Captures with their writer running, fed block by block."""

    def __init__(self, root: Path, settings: CaptureSettings, units: tuple[str, ...]) -> None:
        self.root, self.clock = root, StandingClock()
        self.refuse: Exception | None = None
        self.captures = Captures(
            root,
            settings,
            {unit: self._writer_of(unit) for unit in units},
            dict.fromkeys(units, RATE_HZ),
            self.clock,
        )

    def _writer_of(self, unit: str) -> Callable[[Path, str], RecordingWriter]:
        def make(folder: Path, made_by: str) -> RecordingWriter:
            if self.refuse is not None:
                raise self.refuse
            return RecordingWriter(folder, recorded_unit(unit), made_by)

        return make

    def send(
        self, start: int, stop: int, alarms: dict[int, AlarmNews] | None = None, **how: object
    ) -> None:
        """Let blocks come, with news of alarms by block."""
        for number in range(start, stop):
            news = [alarms[number]] if alarms and number in alarms else []
            self.captures.take(block(number, **how), news)  # type: ignore[arg-type]

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait, half a minute at most."""
        async with asyncio.timeout(30):
            while not condition():
                await asyncio.sleep(0.001)

    async def written(self, n: int) -> list[Recording]:
        """Wait until so many captures are written; all that there are."""
        await self.until(lambda: self.captures.n_written == n and self.captures.n_running == 0)
        return self.recordings()

    def recordings(self) -> list[Recording]:
        """Captures on the disk."""
        return [open_recording(folder) for folder in sorted(self.root.iterdir())]


@asynccontextmanager
async def running(
    root: Path, settings: CaptureSettings = SETTINGS, units: tuple[str, ...] = ("U1",)
) -> AsyncIterator[Rig]:
    """Captures, with their writer running."""
    rig = Rig(root, settings, units)
    task = asyncio.create_task(rig.captures.run())
    yield rig
    task.cancel()
    await asyncio.wait([task])
    await rig.captures.close()


def samples(recording: Recording) -> list[int]:
    """The numbers of the samples in a recording."""
    blocks = recording.blocks()
    return [int(value) for raw in blocks for value in raw.counts[0]]


def numbers(first_block: int, stop_block: int) -> list[int]:
    """Of the samples of some blocks."""
    return list(range(first_block * BLOCK, stop_block * BLOCK))
