"""Alarms of a running service: by samples, links and clocks, kept over restarts and kills."""

import asyncio
import sqlite3
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest
from rigs.alarm_runs import (
    BLOCK_NS,
    LINK,
    PROBE,
    T0,
    changes,
    events,
    lost,
    louder,
    play,
)

from acquisition.errors import LinkError
from core.alarms.alarm import AlarmState
from core.alarms.operation import Acknowledge, Shelve
from core.samples.blocks import DeviceClock, SampleBlock


async def test_a_probe_is_lost_and_works_again_after_delays_in_sample_time(plant, scripted, block):
    too_short, long_enough = (5, 6), range(10, 15)

    await play(
        plant,
        scripted,
        [lost(block(n)) if n in (*too_short, *long_enough) else block(n) for n in range(40)],
    )

    raised, returned = events(plant, alarm=PROBE)
    assert (raised.change, raised.reason, raised.number) == ("raised", "sensor_failure", 1)
    # block 10 shows it first, two seconds later it counts: with the end of block 12
    assert raised.time_ns == T0 + 13 * BLOCK_NS
    # block 15 is the first good one; four seconds after its end, within block 19, it returns
    assert (returned.change, returned.time_ns) == ("returned", T0 + 20 * BLOCK_NS)
    assert plant.alarms.alarm(PROBE).state is AlarmState.RETURNED_UNACKNOWLEDGED


async def test_delays_do_not_run_while_samples_are_missing(plant, scripted, block):
    blocks = [lost(block(0)), *(lost(block(n)) for n in range(400, 402))]

    await play(plant, scripted, blocks)
    assert changes(plant, PROBE) == []
    await play(plant, scripted, [lost(block(n)) for n in range(402, 404)])

    assert changes(plant, PROBE) == ["raised"]


def swell(n: int) -> float:
    """How much louder a shaft of 50 µm is: up to 75 µm, to 100 µm, and back."""
    return next(factor for end, factor in SWELL if n < end)


SWELL = ((30, 1.0), (50, 1.5), (80, 2.0), (110, 1.5), (999, 1.0))


async def test_the_same_samples_give_the_same_events_however_they_come(
    plant, tmp_path, scripted, block
):
    blocks = [louder(block(n), swell(n)) for n in range(150)]
    blocks[90:100] = [lost(each) for each in blocks[90:100]]
    await play(plant, scripted, blocks)
    at_once = events(plant, unit="U1")

    other = type(plant)(tmp_path / "other.sqlite3")
    other.clock.s = 1e6
    pieces = [blocks[start : start + 7] for start in range(0, 150, 7)]
    cut = [[*piece, LinkError("reset by peer")] for piece in pieces[:-1]]
    await play(other, scripted, *cut, pieces[-1])

    of_samples = [event for event in events(other, unit="U1") if event.identity.id != LINK]
    assert of_samples == at_once
    assert {event.change for event in at_once} >= {"raised", "escalated", "returned"}
    other.store.close()


@pytest.mark.parametrize("plant", [3], indirect=True)
async def test_news_of_alarms_outlives_a_failing_store_longer_than_results(plant, scripted, block):
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


async def test_after_a_restart_alarms_are_as_before_but_conditions_unknown(plant, scripted, block):
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
    plant, scripted, block
):
    await play(plant, scripted, [lost(block(n)) for n in range(6)])
    plant.start_alarms()

    await play(plant, scripted, [block(n) for n in range(400, 410)])

    assert changes(plant, PROBE) == ["raised", "condition_unknown", "condition_known", "returned"]


async def test_a_device_that_refuses_is_an_alarm_with_what_it_said(plant, scripted, block):
    refused = [[LinkError("10.0.0.7:502: Connection refused")] for _ in range(60)]

    await play(plant, scripted, [block(0), LinkError("reset by peer")], *refused, [block(1)])

    raised, returned, *_ = events(plant, alarm=LINK)
    assert (raised.change, raised.reason) == ("raised", "10.0.0.7:502: Connection refused")
    assert returned.change == "returned"
    assert 10.0 <= (raised.time_ns - T0) / 1e9 <= 10.6  # of the clock that passes while one waits


async def test_a_unit_that_never_answers_is_an_alarm_too(plant):
    for seconds in (0.0, 5.0, 11.0):
        plant.clock.s = seconds
        plant.alarms.tick()
    await plant.recorder.flush()

    assert {event.identity.id for event in events(plant)} == {LINK, "U2:link:link_lost"}


async def test_a_device_whose_clock_is_off_is_an_alarm_by_the_hosts_clock(plant, block):
    off = DeviceClock(offset_s=-5.0, drift_ppm=None, u_drift_ppm=None)
    for second in range(40):
        plant.clock.s = float(second)
        news = plant.alarms.take(replace(block(second), clock=off), [])
        if second < 30:
            assert news == []
    alarm = plant.alarms.alarm("U1:device:clock_offset")
    assert (alarm.level, alarm.condition.value, alarm.condition.limit) == (1, 5.0, 2.0)
    assert alarm.raised_ns == T0 + 30_000_000_000


N_BLOCKS = 140
LOUD = range(40, 80)
"""Blocks in which the shaft moves 75 µm, of 60 that are an alert. A result needs 15 blocks, and
averages up to 29."""

TWICE = [*range(40, 70), *range(112, N_BLOCKS)]
KILLS = (62, 102)

OF_RESTARTS = ("condition_unknown", "condition_known")

Block = Callable[..., SampleBlock]


def stream(block: Block, loud: Sequence[int] = LOUD) -> list[SampleBlock]:
    """All blocks of a machine that shakes for a while."""
    blocks = [block(number) for number in range(N_BLOCKS)]
    return [
        replace(one, counts=one.counts * 1.5) if number in loud else one
        for number, one in enumerate(blocks)
    ]


async def live_through(plant: Any, scripted: Any, *lives: Sequence[SampleBlock]) -> None:
    """Run the service once for each life; whatever it remembered is gone in between."""
    for blocks in lives:
        plant.start_alarms()
        runner = plant.runner(U1=scripted(blocks), reach=plant.store.reach("U1"))
        await asyncio.wait_for(runner.run(), 60)
        await plant.recorder.flush()


def told(plant: Any, axis: str) -> list[str]:
    """Changes of an amplitude's alarm, oldest first, but for what a restart itself brings."""
    found = changes(plant, f"U1:UJB:order1_shaft_{axis}")
    return [change for change in found if change not in OF_RESTARTS]


@pytest.mark.parametrize("killed_at", [20, 55, 70, 100])
async def test_a_kill_neither_loses_nor_doubles_an_alarm(plant, scripted, block, killed_at):
    blocks = stream(block)
    await live_through(plant, scripted, blocks[:killed_at], blocks[killed_at:])

    assert [told(plant, axis) for axis in "xy"] == [["raised", "returned"]] * 2


@pytest.mark.parametrize("n_away", [0, 3, 40])
async def test_the_hole_is_recorded_from_the_last_stored_result_to_the_first_new_sample(
    plant, scripted, block, n_away
):
    before = stream(block)[:20]
    after = [block(number) for number in range(20 + n_away, 40 + n_away)]
    await live_through(plant, scripted, before)
    reach = plant.store.reach("U1")
    await live_through(plant, scripted, after[:1], after)

    [gap] = plant.store.gaps("U1", 0, 2**62)
    assert (gap.epoch, gap.first_index) == (1, reach.stop_index)
    assert gap.first_index + gap.n_samples == after[0].first_index
    assert (gap.start_ns, gap.stop_ns) == (reach.stop_ns, after[0].start_ns)
    assert not gap.is_estimated


async def test_every_edge_is_told_once_through_restarts(plant, scripted, block):
    blocks = stream(block, TWICE)
    await live_through(
        plant, scripted, blocks[: KILLS[0]], blocks[slice(*KILLS)], blocks[KILLS[1] :]
    )

    assert told(plant, "x") == ["raised", "returned", "raised"]
