"""Alarms of a running service: raised by samples, kept by the store, never cleared by silence."""

import asyncio
import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.errors import LinkError
from acquisition.recording.reader import open_recording
from core.alarms.alarm import AlarmState
from core.alarms.event import AlarmEvent
from core.alarms.operation import Acknowledge, Shelve
from core.blocks import SampleBlock
from core.device_clock import DeviceClock
from core.quality import GOOD, Reason, bad
from service.store.port import AlarmQuery

Make = Callable[..., Any]

PROBE = "U1:sx:channel_not_ok"
AMPLITUDE = "U1:UJB:order1_shaft_x"
LINK = "U1:link:link_lost"
BLOCK_NS = 1_280_000_000
T0 = 1_767_225_600_000_000_000


def lost(block: SampleBlock) -> SampleBlock:
    """The block with its first probe lost."""
    return replace(block, channel_quality=(bad(Reason.SENSOR_FAILURE), GOOD, GOOD, GOOD))


def louder(block: SampleBlock, factor: float) -> SampleBlock:
    return replace(block, samples=block.samples * np.float32(factor))


def events(plant: Any, **wanted: Any) -> list[AlarmEvent]:
    """All stored events, oldest first."""
    found = plant.store.alarm_events(AlarmQuery(limit=10_000, **wanted))
    return [stored.event for stored in reversed(found)]


def changes(plant: Any, alarm: str) -> list[str]:
    return [event.change.value for event in events(plant, alarm=alarm)]


async def play(plant: Any, scripted: Make, *connections: Sequence[Any], flush: bool = True) -> None:
    """Let unit U1 deliver what is given, to the end."""
    await asyncio.wait_for(plant.runner(U1=scripted(*connections)).run(), 60)
    if flush:
        await plant.recorder.flush()


async def test_a_lost_probe_is_raised_in_the_samples_time_and_stored(
    plant: Any, scripted: Make, block: Make
) -> None:
    blocks = [block(n) if n < 5 else lost(block(n)) for n in range(12)]

    await play(plant, scripted, blocks)

    [raised] = events(plant, alarm=PROBE)
    assert (raised.change, raised.reason, raised.number) == ("raised", "sensor_failure", 1)
    # block 5 shows it first, two seconds later it counts: with the end of block 7
    assert raised.time_ns == T0 + 8 * BLOCK_NS
    assert plant.alarms.alarm(PROBE).state is AlarmState.UNACKNOWLEDGED


async def test_a_probe_that_is_lost_for_less_than_its_delay_raises_nothing(
    plant: Any, scripted: Make, block: Make
) -> None:
    await play(plant, scripted, [lost(block(n)) if n in (5, 6) else block(n) for n in range(40)])

    assert changes(plant, PROBE) == []


async def test_a_probe_that_works_again_returns_after_its_delay_and_waits_to_be_seen(
    plant: Any, scripted: Make, block: Make
) -> None:
    await play(plant, scripted, [lost(block(n)) if n < 5 else block(n) for n in range(30)])

    assert changes(plant, PROBE) == ["raised", "returned"]
    assert plant.alarms.alarm(PROBE).state is AlarmState.RETURNED_UNACKNOWLEDGED


async def test_a_lost_link_and_a_gap_leave_a_lost_probe_lost(
    plant: Any, scripted: Make, block: Make
) -> None:
    before = [lost(block(n)) for n in range(5)]
    after = [block(n) for n in range(400, 403)]  # not good for long enough yet

    await play(plant, scripted, [*before, LinkError("reset by peer")], after)

    assert changes(plant, PROBE) == ["raised"]
    alarm = plant.alarms.alarm(PROBE)
    assert alarm.state is AlarmState.UNACKNOWLEDGED
    assert not plant.alarms.is_judged(alarm)  # the recording has ended


async def test_delays_do_not_run_while_samples_are_missing(
    plant: Any, scripted: Make, block: Make
) -> None:
    blocks = [lost(block(0)), *(lost(block(n)) for n in range(400, 402))]

    await play(plant, scripted, blocks)
    assert changes(plant, PROBE) == []
    await play(plant, scripted, [lost(block(n)) for n in range(402, 404)])

    assert changes(plant, PROBE) == ["raised"]


async def test_a_shaft_that_moves_too_much_is_an_alert_then_a_danger_and_comes_down_again(
    plant: Any, scripted: Make, block: Make
) -> None:
    # 50 µm is well; averages over four segments go up to 100 µm and back
    loud = [louder(block(n), 2.0 if 30 <= n < 80 else 1.0) for n in range(150)]

    await play(plant, scripted, loud)

    found = events(plant, alarm=AMPLITUDE)
    assert [e.change for e in found] == ["raised", "escalated", "eased", "returned"]
    assert [e.limit for e in found] == [60.0, 90.0, 60.0, 60.0]
    for event, (low, high) in zip(
        found, ((60.0, 90.0), (90.0, 101.0), (60.0, 85.0), (0.0, 55.0)), strict=True
    ):
        assert event.value is not None
        assert low < event.value <= high
    assert changes(plant, "U1:UJB:order1_shaft_y") == [e.change for e in found]


async def test_an_amplitude_of_a_lost_probe_is_unknown_and_its_alarm_stays(
    plant: Any, scripted: Make, block: Make
) -> None:
    blocks = [louder(block(n), 2.0) for n in range(60)]
    blocks += [lost(louder(block(n), 0.1)) for n in range(60, 120)]

    await play(plant, scripted, blocks)

    assert changes(plant, AMPLITUDE)[-1] == "condition_unknown"
    alarm = plant.alarms.alarm(AMPLITUDE)
    assert (alarm.state, alarm.level) == (AlarmState.UNACKNOWLEDGED, 2)
    assert changes(plant, PROBE) == ["raised"]  # and it is said why
    assert changes(plant, "U1:UJB:order1_shaft_y")[-1] == "returned"


async def test_after_a_restart_alarms_are_what_they_were_and_their_conditions_unknown(
    plant: Any, scripted: Make, block: Make
) -> None:
    await play(plant, scripted, [lost(block(n)) for n in range(6)])
    plant.alarms.operate(PROBE, Acknowledge("A. Name", 1))
    plant.alarms.operate("U1:sy:channel_not_ok", Shelve("A. Name", "known", T0 + 10**14))
    await plant.recorder.flush()

    plant.start_alarms()
    await plant.recorder.flush()

    alarm = plant.alarms.alarm(PROBE)
    assert alarm.state is AlarmState.ACKNOWLEDGED
    assert (alarm.condition.is_known, alarm.condition.reason) == (False, "restarted")
    assert plant.alarms.alarm("U1:sy:channel_not_ok").state is AlarmState.SHELVED
    assert changes(plant, PROBE) == ["raised", "acknowledged", "condition_unknown"]

    await play(plant, scripted, [lost(block(n)) for n in range(400, 404)])
    assert changes(plant, PROBE)[3:] == ["condition_known"]
    assert plant.alarms.alarm(PROBE).occurrence == 1  # announced once, not again


async def test_what_was_repaired_while_the_service_was_down_returns_with_the_first_good_samples(
    plant: Any, scripted: Make, block: Make
) -> None:
    await play(plant, scripted, [lost(block(n)) for n in range(6)])
    plant.start_alarms()

    await play(plant, scripted, [block(n) for n in range(400, 410)])

    assert changes(plant, PROBE) == ["raised", "condition_unknown", "condition_known", "returned"]


async def test_an_alarm_that_nothing_watches_any_more_is_closed_and_says_so(
    plant: Any, scripted: Make, block: Make
) -> None:
    await play(plant, scripted, [lost(block(n)) for n in range(6)])
    with plant.store.database.writing() as writer:  # as if the channel had been renamed since
        writer.execute("UPDATE alarm SET id = 'U1:old:channel_not_ok', subject = 'old'")

    plant.start_alarms()
    await plant.recorder.flush()

    [closed] = events(plant, alarm="U1:old:channel_not_ok")
    assert (closed.change, closed.reason) == ("returned", "no_longer_watched")
    alarm = plant.alarms.alarm("U1:old:channel_not_ok")
    assert alarm.state is AlarmState.RETURNED_UNACKNOWLEDGED
    plant.alarms.operate("U1:old:channel_not_ok", Acknowledge("A. Name", 1))


async def test_a_link_that_is_lost_for_long_is_an_alarm_of_its_own(plant: Any) -> None:
    plant.alarms.link("U1", True)
    plant.alarms.link("U2", True)
    plant.clock.elapsed_s = 100.0
    plant.alarms.link("U1", False, "10.0.0.7:502: no answer")
    plant.clock.elapsed_s = 109.9
    plant.alarms.tick()
    await plant.recorder.flush()
    assert events(plant) == []

    plant.clock.elapsed_s = 110.0
    plant.alarms.tick()
    plant.clock.elapsed_s = 200.0
    plant.alarms.tick()
    plant.alarms.link("U1", True)
    await plant.recorder.flush()

    raised, returned = events(plant, alarm=LINK)
    assert (raised.change, raised.reason) == ("raised", "10.0.0.7:502: no answer")
    assert raised.time_ns == T0 + 110_000_000_000
    assert (returned.change, returned.time_ns) == ("returned", T0 + 200_000_000_000)
    assert changes(plant, "U2:link:link_lost") == []


async def test_a_device_that_refuses_is_an_alarm_with_what_it_said(
    plant: Any, scripted: Make, block: Make
) -> None:
    refused = [[LinkError("10.0.0.7:502: Connection refused")] for _ in range(60)]

    await play(plant, scripted, [block(0), LinkError("reset by peer")], *refused, [block(1)])

    raised, returned, *_ = events(plant, alarm=LINK)
    assert (raised.change, raised.reason) == ("raised", "10.0.0.7:502: Connection refused")
    assert returned.change == "returned"
    assert 10.0 <= (raised.time_ns - T0) / 1e9 <= 10.6  # of the clock that passes while one waits


async def test_a_unit_that_never_answers_is_an_alarm_too(plant: Any) -> None:
    for seconds in (0.0, 5.0, 11.0):
        plant.clock.elapsed_s = seconds
        plant.alarms.tick()
    await plant.recorder.flush()

    assert {event.identity.id for event in events(plant)} == {LINK, "U2:link:link_lost"}


async def test_a_device_whose_clock_is_off_is_an_alarm_by_the_hosts_clock(
    plant: Any, block: Make
) -> None:
    off = DeviceClock(offset_s=-5.0, drift_ppm=None, u_drift_ppm=None)
    for second in range(40):
        plant.clock.elapsed_s = float(second)
        news = plant.alarms.take(replace(block(second), clock=off), [])
        if second < 30:
            assert news == []
    alarm = plant.alarms.alarm("U1:device:clock_offset")
    assert (alarm.level, alarm.condition.value, alarm.condition.limit) == (1, 5.0, 2.0)
    assert alarm.raised_ns == T0 + 30_000_000_000


async def test_the_same_samples_give_the_same_events_however_they_come(
    plant: Any, tmp_path: Path, scripted: Make, block: Make
) -> None:
    blocks = [louder(block(n), 2.0 if 30 <= n < 80 else 1.0) for n in range(150)]
    blocks[90:100] = [lost(each) for each in blocks[90:100]]
    await play(plant, scripted, blocks)
    at_once = events(plant, unit="U1")

    other = type(plant)(tmp_path / "other.sqlite3")
    other.clock.elapsed_s = 1e6
    pieces = [blocks[start : start + 7] for start in range(0, 150, 7)]
    cut = [[*piece, LinkError("reset by peer")] for piece in pieces[:-1]]
    await play(other, scripted, *cut, pieces[-1])

    of_samples = [event for event in events(other, unit="U1") if event.identity.id != LINK]
    assert of_samples == at_once
    assert {event.change for event in at_once} >= {"raised", "escalated", "returned"}
    other.store.close()


async def test_news_of_alarms_outlives_a_store_that_fails_for_longer_than_results_do(
    small_plant: Any, scripted: Make, block: Make
) -> None:
    plant = small_plant
    broken = (
        "CREATE TRIGGER broken BEFORE INSERT ON alarm_event BEGIN SELECT RAISE(ABORT, 'x'); END"
    )
    with sqlite3.connect(plant.path) as connection:
        connection.execute(broken)

    chatter = [lost(block(n)) if n // 10 % 2 else block(n) for n in range(210)]
    await play(plant, scripted, chatter)
    assert plant.live.n_unstored > 0
    with sqlite3.connect(plant.path) as connection:
        connection.execute("DROP TRIGGER broken")
    connection.close()
    await plant.recorder.flush()

    found = events(plant, alarm=PROBE)
    assert [event.number for event in found] == list(range(1, 21))
    assert [event.change for event in found] == ["raised", "returned"] * 10


async def test_the_samples_around_an_alarm_are_kept_as_they_were_sent(
    plant: Any, scripted: Make, block: Make
) -> None:
    sent = [lost(block(n)) if 40 <= n < 50 else block(n) for n in range(80)]

    await play(plant, scripted, sent)
    await plant.captures.close()

    [folder] = plant.capture_folder.iterdir()
    recorded = list(open_recording(folder).raw_blocks())
    # raised with the end of block 42, at 55.04 s: from 45.04 s, in block 35, to 75.04 s, in 58
    assert [raw.first_index // 128 for raw in recorded] == list(range(35, 59))
    for raw, original in zip(recorded, sent[35:59], strict=True):
        assert np.array_equal(raw.counts, original.samples)
        assert raw.start_ns == original.start_ns
        assert raw.ok[0] == (original.channel_quality[0] == GOOD)


@pytest.mark.parametrize("kept", [0, 1])
async def test_a_capture_that_cannot_be_written_disturbs_nothing(
    plant: Any, scripted: Make, block: Make, kept: int
) -> None:
    if not kept:
        plant.capture_folder.write_text("a file where the folder should be")

    await play(plant, scripted, [lost(block(n)) if n >= 40 else block(n) for n in range(80)])
    await plant.captures.close()

    assert changes(plant, PROBE) == ["raised"]
    assert plant.live.status("U1").account.n_offered == 80 * 128
    assert (plant.captures.error is None) == bool(kept)
    assert plant.captures.n_written == kept
