"""Samples around an alarm: exactly those, in a recording that says what it is for."""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from rigs.standing_clock import StandingClock

from acquisition.recording.manifest import RecordedChannel, RecordedUnit
from acquisition.recording.reader import Recording, open_recording
from acquisition.recording.writer import RecordingWriter
from core.alarms.alarm import Alarm, AlarmIdentity, AlarmKind, AlarmLevel, AlarmRule, Condition
from core.alarms.event import AlarmNews
from core.alarms.life_cycle import advance
from core.alarms.operation import Shelve, operate
from core.blocks import SampleBlock
from core.machine import Measurand
from core.quality import GOOD, Reason, bad
from service.capture import captures as module
from service.capture.captures import Captures
from service.capture.outcome import Outcome
from service.capture.span import CaptureSettings

RATE_HZ = 50.0
BLOCK = 10
"""A fifth of a second."""

T0 = 1_767_225_600_000_000_000
SECOND = 1_000_000_000
SETTINGS = CaptureSettings(pre_s=3.0, post_s=5.0, max_s=12.0)
ALERT = Condition(AlarmLevel.ALERT, value=160.0, limit=150.0, reason="above_limit")


def recorded_unit(unit: str) -> RecordedUnit:
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
    number: int, unit: str = "U1", lost: bool = False, start_ns: int | None = None
) -> SampleBlock:
    """Channel a is the number of the sample."""
    first = number * BLOCK
    index = np.arange(first, first + BLOCK, dtype=np.float32)
    return SampleBlock(
        unit=unit,
        epoch=1,
        first_index=first,
        start_ns=T0 + number * SECOND // 5 if start_ns is None else start_ns,
        rate_hz=RATE_HZ,
        samples=np.array([index, -index]),
        channel_quality=(bad(Reason.SENSOR_FAILURE) if lost else GOOD, GOOD),
    )


def raised(
    at_s: float, kind: AlarmKind = AlarmKind.SHAFT_X, unit: str = "U1", shelved: bool = False
) -> AlarmNews:
    alarm = Alarm(AlarmIdentity(unit, "UJB", kind))
    if shelved:
        alarm, _ = operate(alarm, Shelve("A. Name", "known", T0 + 10**15), T0)
    return AlarmNews(*advance(alarm, ALERT, T0 + round(at_s * SECOND), AlarmRule()))


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
        for number in range(start, stop):
            news = [alarms[number]] if alarms and number in alarms else []
            self.captures.take(block(number, **how), news)  # type: ignore[arg-type]

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(30):
            while not condition():
                await asyncio.sleep(0.001)

    async def written(self, n: int) -> list[Recording]:
        await self.until(lambda: self.captures.n_written == n and self.captures.n_running == 0)
        return self.recordings()

    def recordings(self) -> list[Recording]:
        return [open_recording(folder) for folder in sorted(self.root.iterdir())]


@asynccontextmanager
async def running(
    root: Path, settings: CaptureSettings = SETTINGS, units: tuple[str, ...] = ("U1",)
) -> AsyncIterator[Rig]:
    rig = Rig(root, settings, units)
    task = asyncio.create_task(rig.captures.run())
    yield rig
    task.cancel()
    await asyncio.wait([task])
    await rig.captures.close()


@pytest.fixture
def root(tmp_path: Path) -> Path:
    return tmp_path / "captures"


def samples(recording: Recording) -> list[int]:
    """The numbers of the samples in a recording."""
    blocks = recording.raw_blocks()
    return [int(value) for raw in blocks for value in raw.counts[0]]


def numbers(first_block: int, stop_block: int) -> list[int]:
    return list(range(first_block * BLOCK, stop_block * BLOCK))


async def test_a_capture_holds_exactly_the_samples_around_the_alarm(root: Path) -> None:
    async with running(root) as rig:
        # block 49 ends at 10 s, when the alarm is raised: from 7 s to 15 s
        rig.send(0, 100, {49: raised(10.0)})
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(35, 75)
    blocks = list(recording.raw_blocks())
    assert [raw.start_ns for raw in blocks] == [block(n).start_ns for n in range(35, 75)]
    assert np.array_equal(blocks[0].counts, block(35).samples)


async def test_blocks_that_are_only_partly_within_are_kept_whole(root: Path) -> None:
    async with running(root) as rig:
        rig.send(0, 100, {50: raised(10.1)})
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(35, 76)


async def test_a_capture_says_which_alarm_it_is_for_and_bears_its_name(root: Path) -> None:
    async with running(root) as rig:
        rig.send(0, 100, {49: raised(10.0)})
        [recording] = await rig.written(1)

    assert recording.folder.name == "U1-20260101T000010.000Z-order1_shaft_x"
    assert "alarm U1:UJB:order1_shaft_x occurrence 1" in recording.manifest.made_by
    [alarm] = json.loads((recording.folder / "alarm.json").read_text())["alarms"]
    assert alarm == {
        "alarm": "U1:UJB:order1_shaft_x",
        "occurrence": 1,
        "change": "raised",
        "level": "alert",
        "time": "2026-01-01T00:00:10.000Z",
        "time_ns": T0 + 10 * SECOND,
        "value": 160.0,
        "limit": 150.0,
        "reason": "above_limit",
    }


async def test_a_lost_probe_is_captured_with_what_the_channel_was_found_to_be(root: Path) -> None:
    async with running(root) as rig:
        rig.send(0, 40)
        rig.send(40, 41, {40: raised(8.2)}, lost=True)
        rig.send(41, 100, lost=True)
        [recording] = await rig.written(1)

    ok = [raw.ok[0] for raw in recording.raw_blocks()]
    assert ok == [True] * 14 + [False] * 26


async def test_another_alarm_prolongs_the_capture_instead_of_beginning_one(root: Path) -> None:
    async with running(root) as rig:
        second = raised(12.0, AlarmKind.CHANNEL_NOT_OK)
        rig.send(0, 150, {49: raised(10.0), 59: second})
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(35, 85)
    alarms = json.loads((recording.folder / "alarm.json").read_text())["alarms"]
    assert [alarm["alarm"].rpartition(":")[2] for alarm in alarms] == [
        "order1_shaft_x",
        "channel_not_ok",
    ]


async def test_no_capture_is_longer_than_it_may_be(root: Path) -> None:
    async with running(root) as rig:
        chatter = {n: raised((n + 1) / 5) for n in range(49, 100, 10)}
        rig.send(0, 160, chatter)
        first, second = await rig.written(2)

    assert samples(first) == numbers(35, 95)  # twelve seconds
    assert samples(second) == numbers(85, 125)


async def test_the_next_alarm_after_it_begins_a_new_one(root: Path) -> None:
    async with running(root) as rig:
        rig.send(0, 200, {49: raised(10.0), 99: raised(20.0)})
        first, second = await rig.written(2)

    assert (samples(first), samples(second)) == (numbers(35, 75), numbers(85, 125))


async def test_two_units_are_captured_side_by_side(root: Path) -> None:
    async with running(root, units=("U1", "U2")) as rig:
        for number in range(100):
            first = [raised(10.0)] if number == 49 else []
            second = [raised(11.0, unit="U2")] if number == 54 else []
            rig.captures.take(block(number), first)
            rig.captures.take(block(number, "U2"), second)
        one, two = await rig.written(2)

    assert (one.manifest.unit, two.manifest.unit) == ("U1", "U2")
    assert (samples(one), samples(two)) == (numbers(35, 75), numbers(40, 80))


@pytest.mark.parametrize(
    "news",
    [
        raised(10.0, AlarmKind.CLOCK_DRIFT),
        raised(10.0, AlarmKind.TIME_STAMPS),
        raised(10.0, shelved=True),
    ],
    ids=["clock", "stamps", "shelved"],
)
async def test_what_samples_do_not_explain_or_nobody_wants_to_see_is_not_captured(
    root: Path, news: AlarmNews
) -> None:
    async with running(root) as rig:
        rig.send(0, 100, {49: news})
        assert rig.captures.n_running == 0
    assert not root.exists()


async def test_a_capture_that_begins_right_after_the_start_has_what_there_is(root: Path) -> None:
    async with running(root) as rig:
        rig.send(0, 100, {2: raised(0.6)})
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(0, 28)


async def test_samples_that_are_missing_or_repeated_are_so_in_the_capture(root: Path) -> None:
    async with running(root) as rig:
        rig.send(0, 50, {49: raised(10.0)})
        rig.send(45, 50)  # once more
        rig.send(60, 100)
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(35, 50) + numbers(60, 75)


async def test_a_device_whose_clock_is_put_back_ends_its_capture_by_count(root: Path) -> None:
    async with running(root) as rig:
        rig.send(0, 50, {49: raised(10.0)})
        for number in range(50, 200):
            rig.captures.take(block(number, start_ns=T0 + (number - 40) * SECOND // 5), [])
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(35, 95)


async def test_a_link_that_is_lost_leaves_a_finished_capture_after_a_while(root: Path) -> None:
    async with running(root) as rig:
        rig.send(0, 60, {49: raised(10.0)})
        rig.clock.s = 34.0
        await rig.until(lambda: any(root.iterdir()) if root.exists() else False)
        assert rig.captures.n_written == 0
        rig.clock.s = 36.0
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(35, 60)


async def test_a_service_that_stops_finishes_the_capture_with_what_there_is(root: Path) -> None:
    async with running(root) as rig:
        rig.send(0, 60, {49: raised(10.0)})
    [recording] = rig.recordings()

    assert samples(recording) == numbers(35, 60)


async def test_a_disk_that_refuses_is_told_and_the_next_capture_is_written(root: Path) -> None:
    async with running(root) as rig:
        rig.refuse = OSError(28, "No space left on device")
        rig.send(0, 100, {49: raised(10.0)})
        await rig.until(lambda: rig.captures.error is not None and rig.captures.n_running == 0)
        assert rig.captures.error is not None
        assert "No space left on device" in rig.captures.error
        assert "U1:UJB:order1_shaft_x" in rig.captures.error
        rig.refuse = None
        rig.send(100, 200, {149: raised(30.0)})
        [recording] = await rig.written(1)
        assert rig.captures.error is None

    assert samples(recording) == numbers(135, 175)


async def test_a_disk_that_fails_half_way_leaves_nothing_behind(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_: RecordingWriter) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(RecordingWriter, "finish", refuse)
    async with running(root) as rig:
        rig.send(0, 100, {49: raised(10.0)})
        await rig.until(lambda: rig.captures.error is not None and rig.captures.n_running == 0)

    assert list(root.iterdir()) == []


async def test_a_disk_that_is_too_slow_costs_the_capture_and_no_memory(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MAX_PENDING_SAMPLES", 2 * 20 * BLOCK)
    rig = Rig(root, SETTINGS, ("U1",))  # nobody writes
    rig.send(0, 60, {49: raised(10.0)})

    assert sum(c.n_pending_samples for c in rig.captures._all) == 0
    await rig.captures.close()
    assert rig.captures.error is not None
    assert "too slow" in rig.captures.error
    assert list(root.iterdir()) == []


async def test_what_a_crash_has_left_unfinished_is_removed_at_the_start(root: Path) -> None:
    left = root / "U1-20260101T000010.000Z-order1_shaft_x.incomplete"
    left.mkdir(parents=True)
    (left / "samples.parquet").write_bytes(b"PAR1 and no footer")

    async with running(root) as rig:
        await rig.until(lambda: not left.exists())


async def test_two_alarms_at_the_same_time_do_not_meet_in_one_folder(root: Path) -> None:
    for _ in range(2):  # the service restarts, the device's clock has been put back
        async with running(root) as rig:
            rig.send(0, 100, {49: raised(10.0)})
            await rig.until(lambda rig=rig: rig.captures.n_written == 1)  # type: ignore[misc]

    names = sorted(path.name for path in root.iterdir())
    assert names == [names[0], f"{names[0]}-2"]


async def test_a_changed_film_keeps_the_whole_averaging_window_before_it(root: Path) -> None:
    settings = CaptureSettings(pre_s=3.0, post_s=2.0, max_s=12.0, window_s=8.0)
    async with running(root, settings) as rig:
        rig.send(0, 100, {49: raised(10.0, AlarmKind.STIFFNESS_X)})
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(10, 60)


async def test_what_becomes_of_a_capture_is_told_once(root: Path) -> None:
    async with running(root) as rig:
        told: list[Outcome] = []
        rig.captures.tell(told.append)
        rig.send(0, 100, {49: raised(10.0)})
        [recording] = await rig.written(1)

    assert [(outcome.folder, outcome.reason) for outcome in told] == [(recording.folder, None)]
    assert [event.occurrence for event in told[0].alarms] == [1]


async def test_a_capture_that_cannot_be_written_is_told_with_its_reason(root: Path) -> None:
    async with running(root) as rig:
        told: list[Outcome] = []
        rig.captures.tell(told.append)
        rig.refuse = OSError(28, "No space left on device")
        rig.send(0, 60, {49: raised(10.0)})
        await rig.until(lambda: bool(told))

    assert told[0].folder is None
    assert "No space left on device" in str(told[0].reason)
