"""Captures that cannot be finished, or not be written, disturb nothing and are told."""

from pathlib import Path

import pytest
from rigs.capturing import BLOCK, SETTINGS, Rig, numbers, raised, running, samples

from acquisition.recordings.writer import RecordingWriter
from service.recordings import around_alarms as module
from service.recordings.around_alarms import Outcome


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
        told: list[Outcome] = []
        rig.captures.set_listener(told.append)
        rig.refuse = OSError(28, "No space left on device")
        rig.send(0, 100, {49: raised(10.0)})
        await rig.until(lambda: rig.captures.error is not None and rig.captures.n_running == 0)
        assert "No space left on device" in str(rig.captures.error)
        assert "U1:UJB:order1_shaft_x" in str(rig.captures.error)
        rig.refuse = None
        rig.send(100, 200, {149: raised(30.0)})
        [recording] = await rig.written(1)
        assert rig.captures.error is None

    assert samples(recording) == numbers(135, 175)
    assert [outcome.folder for outcome in told] == [None, recording.folder]
    assert "No space left on device" in str(told[0].reason)
    assert told[1].reason is None
    assert [event.occurrence for event in told[1].alarms] == [1]


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
