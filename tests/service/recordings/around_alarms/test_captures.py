"""Samples around an alarm: exactly those, and captures that cannot be finished or written."""

import json

import numpy as np
import pytest
from rigs.capturing import (
    BLOCK,
    SECOND,
    SETTINGS,
    T0,
    Rig,
    block,
    numbers,
    raised,
    running,
    samples,
)

from acquisition.recordings.writer import RecordingWriter
from service.recordings import around_alarms as module
from service.recordings.around_alarms import CaptureSettings, Outcome


@pytest.mark.parametrize(
    ("at_block", "at_s", "expected"),
    [
        pytest.param(49, 10.0, range(35, 75), id="from 7 s to 15 s"),
        pytest.param(50, 10.1, range(35, 76), id="blocks that are partly within are kept whole"),
        pytest.param(2, 0.6, range(28), id="right after the start"),
    ],
)
async def test_a_capture_holds_exactly_the_samples_around_the_alarm(root, at_block, at_s, expected):
    async with running(root) as rig:
        rig.send(0, 100, {at_block: raised(at_s)})
        [recording] = await rig.written(1)

    blocks = [cell for joined in recording.blocks() for cell in joined.cells()]
    assert [raw.start_ns for raw in blocks] == [block(n).start_ns for n in expected]
    for raw, number in zip(blocks, expected, strict=True):
        assert np.array_equal(raw.counts, block(number).samples)


async def test_a_capture_says_which_alarm_it_is_for_and_bears_its_name(root):
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


async def test_a_lost_probe_is_captured_with_what_the_channel_was_found_to_be(root):
    async with running(root) as rig:
        rig.send(0, 40)
        rig.send(40, 41, {40: raised(8.2)}, lost=True)
        rig.send(41, 100, lost=True)
        [recording] = await rig.written(1)

    ok = [ok for block in recording.blocks() for ok in block.side.ok[0].tolist()]
    assert ok == [True] * 14 + [False] * 26


@pytest.mark.parametrize(
    ("alarms_s", "sent", "expected"),
    [
        pytest.param([10, 20], [(0, 200)], [[(35, 75)], [(85, 125)]], id="each alarm its own"),
        pytest.param(
            range(10, 21, 2), [(0, 160)], [[(35, 95)], [(85, 125)]], id="twelve seconds at most"
        ),
        pytest.param(
            *([10], [(0, 50), (45, 50), (60, 100)], [[(35, 50), (60, 75)]]),
            id="samples that are missing or repeated are so in the capture",
        ),
    ],
)
async def test_captures_hold_no_more_and_no_less_than_they_should(root, alarms_s, sent, expected):
    async with running(root) as rig:
        rig.send(*sent[0], {5 * at_s - 1: raised(at_s) for at_s in alarms_s})
        for start, stop in sent[1:]:
            rig.send(start, stop)
        found = await rig.written(len(expected))

    assert [samples(one) for one in found] == [
        [number for span in spans for number in numbers(*span)] for spans in expected
    ]


async def test_two_units_are_captured_side_by_side(root):
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
        raised(10.0, "clock_drift"),
        raised(10.0, "time_stamps"),
        raised(10.0, shelved=True),
    ],
    ids=["clock", "stamps", "shelved"],
)
async def test_what_samples_do_not_explain_or_nobody_wants_to_see_is_not_captured(root, news):
    async with running(root) as rig:
        rig.send(0, 100, {49: news})
        assert rig.captures.n_running == 0
    assert not root.exists()


async def test_a_device_whose_clock_is_put_back_ends_its_capture_by_count(root):
    async with running(root) as rig:
        rig.send(0, 50, {49: raised(10.0)})
        for number in range(50, 200):
            rig.captures.take(block(number, start_ns=T0 + (number - 40) * SECOND // 5), [])
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(35, 95)


async def test_a_changed_film_keeps_the_whole_averaging_window_before_it(root):
    settings = CaptureSettings(pre_s=3.0, post_s=2.0, max_s=12.0, window_s=8.0)
    async with running(root, settings) as rig:
        rig.send(0, 100, {49: raised(10.0, "film_stiffness")})
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(10, 60)


@pytest.mark.parametrize("pause", [False, True])
async def test_another_alarm_prolongs_the_capture_at_both_ends_and_begins_none(root, pause):
    settings = CaptureSettings(pre_s=3.0, post_s=4.0, max_s=14.0, window_s=8.0)
    film = raised(12.0, "film_stiffness")
    told: list[Outcome] = []
    async with running(root, settings) as rig:
        rig.captures.set_listener(told.append)
        rig.send(0, 52, {49: raised(10.0)})
        if pause:  # a part of it is on the disk already
            await rig.until(lambda: any(root.glob("*.incomplete")))
        rig.send(52, 100, {59: film})
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(20, 80)
    assert recording.folder.name == "U1-20260101T000010.000Z-order1_shaft_x"
    alarms = json.loads((recording.folder / "alarm.json").read_text())["alarms"]
    assert [(alarm["alarm"].rpartition(":")[2], alarm["time_ns"]) for alarm in alarms] == [
        ("order1_shaft_x", T0 + 10 * SECOND),
        ("film_stiffness", T0 + 12 * SECOND),
    ]
    assert [(len(outcome.alarms), outcome.folder) for outcome in told] == [(2, recording.folder)]
    assert rig.captures.n_failed == 0


async def test_a_link_that_is_lost_leaves_a_finished_capture_after_a_while(root):
    async with running(root) as rig:
        rig.send(0, 60, {49: raised(10.0)})
        rig.clock.s = 34.0
        await rig.until(lambda: any(root.iterdir()) if root.exists() else False)
        assert rig.captures.n_written == 0
        rig.clock.s = 36.0
        [recording] = await rig.written(1)

    assert samples(recording) == numbers(35, 60)


async def test_a_service_that_stops_finishes_the_capture_with_what_there_is(root):
    async with running(root) as rig:
        rig.send(0, 60, {49: raised(10.0)})
    [recording] = rig.recordings()

    assert samples(recording) == numbers(35, 60)


async def test_a_disk_that_refuses_is_told_and_the_next_capture_is_written(root):
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


async def test_a_disk_that_fails_half_way_leaves_nothing_behind(root, monkeypatch):
    def refuse(_: RecordingWriter) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(RecordingWriter, "finish", refuse)
    async with running(root) as rig:
        rig.send(0, 100, {49: raised(10.0)})
        await rig.until(lambda: rig.captures.error is not None and rig.captures.n_running == 0)

    assert list(root.iterdir()) == []


async def test_a_disk_that_is_too_slow_costs_the_capture_and_no_memory(root, monkeypatch):
    monkeypatch.setattr(module, "MAX_PENDING_SAMPLES", 2 * 20 * BLOCK)
    rig = Rig(root, SETTINGS, ("U1",))  # nobody writes
    rig.send(0, 60, {49: raised(10.0)})

    assert sum(c.n_pending_samples for c in rig.captures._all) == 0
    await rig.captures.close()
    assert rig.captures.error is not None
    assert "too slow" in rig.captures.error
    assert list(root.iterdir()) == []


async def test_what_a_crash_has_left_unfinished_is_removed_at_the_start(root):
    left = root / "U1-20260101T000010.000Z-order1_shaft_x.incomplete"
    left.mkdir(parents=True)
    (left / "samples.parquet").write_bytes(b"PAR1 and no footer")

    async with running(root) as rig:
        await rig.until(lambda: not left.exists())


async def test_two_alarms_at_the_same_time_do_not_meet_in_one_folder(root):
    for _ in range(2):  # the service restarts, the device's clock has been put back
        async with running(root) as rig:
            rig.send(0, 100, {49: raised(10.0)})
            await rig.until(lambda rig=rig: rig.captures.n_written == 1)  # type: ignore[misc]

    names = sorted(path.name for path in root.iterdir())
    assert names == [names[0], f"{names[0]}-2"]
