"""A unit of which nothing comes is lost, and stays lost, whoever starts and stops meanwhile."""

import asyncio
from collections.abc import AsyncIterator, Collection
from contextlib import ExitStack, asynccontextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import pytest
from harness.ledger_plant import LedgerPlant
from harness.moving_unit import Life, Message, MovingUnit
from harness.stream_rig import analysing, blocks

from service.cluster.frames import encoded_block
from service.cluster.silent_units import SilenceWatch, silences_s
from service.live.status import LinkState
from service.settings.plant import load_plant_file
from service.store.port import AlarmQuery

LEDGER = LedgerPlant(n_units=1, load=1.0, segment_samples=1024, n_segments=3)
UNIT = "U1"
LINK = f"{UNIT}:link:link_lost"
LOST = f"plant:{UNIT}:samples_lost"
AFTER_S = 30.0
LINK_DELAY_S = 10.0
SURELY_S = AFTER_S + LINK_DELAY_S + 5.0
N_BLOCKS = 9
TICKS_PER_S = 2


class Back(StrEnum):
    """What there is on the stream after a restart."""

    NO_STREAM = "the servers are away"
    NO_WINDOW = "what was taken in is there no more"
    WINDOW = "what was taken in is there"


@dataclass
class Process:
    """One that analyses the unit, and sees whether it is silent."""

    life: Life
    silence: SilenceWatch
    clock: Any
    is_reached: bool = True
    waiting: Collection[str] = ()

    async def take(self, messages: list[Message]) -> None:
        """Take messages in, a second each, and store what comes of them."""
        for sequence, payload in messages:
            await self.life.progress.take(sequence, payload)
            await self.life.store()
            await self.wait(1.0)

    async def wait(self, seconds: float) -> None:
        """Let time pass in which nothing comes."""
        alarms = self.life.analysis.alarms
        for _ in range(round(TICKS_PER_S * seconds)):
            self.clock.step(1 / TICKS_PER_S)
            alarms.tick()
            begun = {UNIT: self.life.progress} if self.is_reached else {}
            self.silence.look(begun, None, self.waiting)
        await self.life.analysis.recorder.flush()

    @property
    def changes(self) -> list[tuple[str, int]]:
        """What became of the alarm about the link, oldest first, with its occurrence."""
        return self.changes_of(LINK)

    def changes_of(self, alarm: str) -> list[tuple[str, int]]:
        """What became of an alarm, oldest first, with its occurrence."""
        found = self.life.analysis.store.alarm_events(AlarmQuery(alarm=alarm))
        events = [(event.event.change.value, event.event.occurrence) for event in reversed(found)]
        return [each for each in events if not each[0].startswith("condition")]

    @property
    def n_judged(self) -> int:
        """How many alarms of channels count as judged."""
        alarms = self.life.analysis.alarms
        channels = [a for a in alarms.alarms if a.identity.kind == "channel_not_ok"]
        return sum(alarms.is_judged(alarm) for alarm in channels)


class Place:
    """Where one process after the other analyses the unit."""

    def __init__(self, folder: Path, clock: Any) -> None:
        ports = dict.fromkeys(LEDGER.units, 9)
        self._unit = MovingUnit(LEDGER.write(folder / "plant.toml", folder / "data", ports), clock)
        self._clock = clock
        sent = blocks(self._unit.plant, UNIT, 2 * N_BLOCKS, 1)
        identity = self._unit.identity
        self.messages = [
            (n, encoded_block(b, identity, clock.now_ns())) for n, b in enumerate(sent, 1)
        ]
        self.first = self.messages[:N_BLOCKS]

    @asynccontextmanager
    async def process(self, back: Back = Back.WINDOW) -> AsyncIterator[Process]:
        """Start one; it is killed in the end."""
        with ExitStack() as stack:
            life = await self._unit.begun(len(self.messages), stack)
            analysis = life.analysis
            parts = (analysis.analyser, analysis.live, self._clock)
            process = Process(life, SilenceWatch({UNIT: AFTER_S}, *parts), self._clock)
            process.is_reached = back is not Back.NO_STREAM
            stored = life.progress.is_replaying
            if back is Back.WINDOW:
                life.progress.reaches_back(1)
                for sequence, payload in self.first if stored else []:
                    await life.progress.take(sequence, payload)
            elif back is Back.NO_WINDOW:
                life.progress.reaches_back(N_BLOCKS + 1)
            yield process
            await life.close()


@pytest.fixture
def place(tmp_path: Path, stepped_clock: Any) -> Place:
    return Place(tmp_path, stepped_clock)


@pytest.mark.parametrize("back", Back)
async def test_a_lost_unit_stays_lost_through_restarts_until_blocks_come(place, back):
    async with place.process() as first:
        await first.take(place.messages[:N_BLOCKS])
        assert (first.changes, first.n_judged > 0) == ([], True)
        await first.wait(SURELY_S)
        assert first.changes == [("raised", 1)]
    for _ in range(2):
        async with place.process(back) as again:
            await again.wait(3 * SURELY_S)
            assert (again.changes, again.n_judged) == ([("raised", 1)], 0)
    async with place.process(back) as last:
        last.is_reached = True
        await last.take(place.messages[N_BLOCKS:])
        assert last.changes == [("raised", 1), ("returned", 1)]
        assert last.n_judged > 0


@pytest.mark.parametrize("back", Back)
async def test_a_unit_that_falls_silent_while_not_analysed_is_lost_after_the_start(place, back):
    async with place.process() as first:
        await first.take(place.messages[:N_BLOCKS])
    async with place.process(back) as again:
        await again.wait(AFTER_S - 1.0)
        assert again.changes == []
        await again.wait(SURELY_S)
        assert (again.changes, again.n_judged) == ([("raised", 1)], 0)
        status = again.life.analysis.live.status(UNIT)
        assert (status.state, status.n_failed) == (LinkState.NOT_CONNECTED, 1)
        assert status.reason


@pytest.mark.parametrize("back", [Back.NO_STREAM, Back.NO_WINDOW])
async def test_a_unit_of_which_nothing_was_ever_known_is_lost(place, back):
    async with place.process(back) as first:
        await first.wait(SURELY_S)
        assert (first.changes, first.n_judged) == ([("raised", 1)], 0)
        first.is_reached = True
        await first.take(place.messages)
        assert first.changes == [("raised", 1), ("returned", 1)]


async def test_a_unit_whose_messages_are_all_of_no_use_is_lost_and_the_reason_is_said(place):
    async with place.process() as first:
        await first.take([(n, b"no block of ours") for n in range(1, 60)])
        status = first.life.analysis.live.status(UNIT)
        assert status.state is LinkState.NOT_CONNECTED
        assert "padwatch acquire" not in str(status.reason)


@pytest.mark.parametrize("is_kept_as_lost", [False, True])
async def test_a_process_killed_after_blocks_came_back_raises_none_again(place, is_kept_as_lost):
    async with place.process() as first:
        await first.take(place.messages[:N_BLOCKS])
        await first.wait(SURELY_S)
        if is_kept_as_lost:
            await first.life.store()
        await first.life.progress.take(*place.messages[N_BLOCKS])
        await first.wait(1.0)  # the alarm has returned; the block was not stored
        assert first.changes == [("raised", 1), ("returned", 1)]
    async with place.process() as again:
        await again.wait(AFTER_S - 1.0)
        await again.take(place.messages[N_BLOCKS:])
        assert again.changes == [("raised", 1), ("returned", 1)]


async def test_samples_that_were_lost_before_are_no_new_loss_to_a_process_that_takes_over(place):
    place.first = [*place.messages[:2], *place.messages[5:N_BLOCKS]]
    raised = [("raised", 1)]
    async with place.process() as first:
        await first.take(place.first)
        await first.life.store()
        assert first.changes_of(LOST) == raised
        account = first.life.analysis.live.status(UNIT).account
    async with place.process() as again:
        assert again.life.analysis.live.status(UNIT).account == account
        await again.wait(2.0)
        await again.take(place.messages[N_BLOCKS:])
        await again.wait(500.0)
        assert again.changes_of(LOST) == raised
        await again.wait(200.0)
        assert again.changes_of(LOST) == [*raised, ("returned", 1)]


def test_a_unit_whose_blocks_come_seldom_may_be_silent_for_three_of_them(tmp_path):
    stream = '[stream]\nservers = ["nats://127.0.0.1:9"]\n'
    ports = dict.fromkeys(LEDGER.units, 9)
    plant = load_plant_file(LEDGER.write(tmp_path / "plant.toml", tmp_path / "data", ports, stream))
    assert plant.stream is not None
    often = plant.unit[0]
    seldom = often.model_copy(update={"id": "U9", "block_samples": round(60 * often.rate_hz)})
    after_s = silences_s([often, seldom], plant.stream.silent_after_s)
    assert after_s == {UNIT: 5.0, "U9": pytest.approx(180.0, rel=1e-3)}


async def test_a_unit_whose_blocks_wait_for_the_store_is_not_silent(place):
    async with place.process() as first:
        await first.take(place.messages[:N_BLOCKS])
        first.waiting = [UNIT]
        await first.wait(3 * SURELY_S)
        assert first.changes == []
        first.waiting = []
        await first.take(place.messages[N_BLOCKS:])
        assert (first.changes, first.n_judged > 0) == ([], True)
        await first.wait(SURELY_S)
        assert first.changes == [("raised", 1)]


async def test_a_process_that_never_reaches_the_stream_says_that_its_units_are_lost(tmp_path):
    stream = '[stream]\nservers = ["nats://127.0.0.1:9"]\nsilent_after_s = 2.0\n'
    ports = dict.fromkeys(LEDGER.units, 9)
    plant = LEDGER.write(tmp_path / "plant.toml", tmp_path / "data", ports, stream)
    async with analysing(load_plant_file(plant)) as analysis:
        async with asyncio.timeout(60.0):
            while analysis.live.status(UNIT).state is LinkState.CONNECTING:
                await asyncio.sleep(0.01)
        status = analysis.live.status(UNIT)
    assert status.state is LinkState.NOT_CONNECTED
    assert "127.0.0.1:9 cannot be reached" in str(status.reason)
