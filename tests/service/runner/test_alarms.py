"""Alarms of a running service: raised by samples, kept by the store, never cleared by silence."""

import sqlite3
from pathlib import Path
from typing import Any

import pytest
from rigs.alarm_runs import (
    BLOCK_NS,
    LINK,
    PROBE,
    T0,
    Make,
    changes,
    events,
    lost,
    louder,
    play,
)

from acquisition.errors import LinkError
from core.alarms.alarm import AlarmState


async def test_a_probe_is_lost_and_works_again_after_delays_in_the_samples_time(
    plant: Any, scripted: Make, block: Make
) -> None:
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


async def test_delays_do_not_run_while_samples_are_missing(
    plant: Any, scripted: Make, block: Make
) -> None:
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
    plant: Any, tmp_path: Path, scripted: Make, block: Make
) -> None:
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
async def test_news_of_alarms_outlives_a_store_that_fails_for_longer_than_results_do(
    plant: Any, scripted: Make, block: Make
) -> None:
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
