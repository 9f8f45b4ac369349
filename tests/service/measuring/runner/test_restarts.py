"""A service that is killed in the middle tells what one tells that was not, but for the hole."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest
from rigs.alarm_runs import changes

from core.alarms import board, life_cycle
from core.alarms.alarm import Alarm
from core.limits import ON
from core.samples.blocks import SampleBlock

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
async def test_a_kill_neither_loses_nor_doubles_an_alarm(
    plant: Any, scripted: Any, block: Block, killed_at: int
) -> None:
    blocks = stream(block)
    await live_through(plant, scripted, blocks[:killed_at], blocks[killed_at:])

    assert [told(plant, axis) for axis in "xy"] == [["raised", "returned"]] * 2


@pytest.mark.parametrize("n_away", [0, 3, 40])
async def test_the_hole_is_recorded_from_the_last_stored_result_to_the_first_new_sample(
    plant: Any, scripted: Any, block: Block, n_away: int
) -> None:
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


def _on_whatever_was(alarm: Alarm) -> Alarm:
    """Believe that everything was active before, so that nothing begins."""
    return replace(alarm, timers=(ON, ON))


def _nothing_was(alarm: Alarm) -> Alarm:
    """Believe that nothing was active before, so that what is begins once more."""
    return life_cycle.restored(replace(alarm, level=None))


PLANTED = pytest.mark.planted("alarm edge lost or doubled by a restart")


@pytest.mark.parametrize(
    "bug", [None, *(pytest.param(bug, marks=PLANTED) for bug in (_on_whatever_was, _nothing_was))]
)
async def test_every_edge_is_told_once_and_a_bug_of_restarts_is_found_out(
    plant: Any, scripted: Any, block: Block, bug: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    if bug is not None:
        monkeypatch.setattr(board, "restored", bug)
    blocks = stream(block, TWICE)
    await live_through(
        plant, scripted, blocks[: KILLS[0]], blocks[slice(*KILLS)], blocks[KILLS[1] :]
    )

    assert (told(plant, "x") == ["raised", "returned", "raised"]) == (bug is None)
