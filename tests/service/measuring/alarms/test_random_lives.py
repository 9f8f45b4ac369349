"""Random sequences of alarm events, acknowledgements, shelves, failing disks and restarts.

The life cycle itself has a model of its own in the tests of the core. Here what a crash leaves is
compared with what was written before it, and the end of each sequence with the events in the
database. ``PADWATCH_SEQUENCES=10000`` leads as many lives as padwatch's figures are given for.
"""

import asyncio
import os
import random
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigs.blocks import given_block
from rigs.tiers import first_fast

from core.alarms.alarm import ANNOUNCED, Alarm, AlarmChange, AlarmEvent, AlarmState
from core.alarms.operation import (
    Acknowledge,
    Action,
    ActionRefusedError,
    Comment,
    Reset,
    ReturnToService,
    Shelve,
    TakeOutOfService,
    Unshelve,
    operate,
)
from core.alarms.rules import UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.limits import AlarmLevel, Judgement, unknown
from core.quality import GOOD, Reason, bad
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.live_view import LiveView
from service.measuring.recorder import Recorder
from service.store.port import AlarmQuery
from service.store.sqlite import SqliteStore

N_LIVES = int(os.environ.get("PADWATCH_SEQUENCES", "150"))
N_STEPS = 40

SECOND = 1_000_000_000
FILM = "U1:UJB:film_stiffness"
PROBE, LINK = "U1:sx:channel_not_ok", "U1:link:link_lost"
ALARMS = (FILM, PROBE, LINK)


Kept = tuple[int, int, bool, bool, bool, bool]
"""Level, occurrence, whether it was seen, and whether design, shelf or outage hide an alarm."""

NEVER_RAISED: Kept = (0, 0, True, False, False, False)


def kept(alarms: Iterable[Alarm]) -> dict[str, Kept]:
    """What must outlast a crash, by alarm."""
    return dict.fromkeys(ALARMS, NEVER_RAISED) | {
        each.identity.id: (
            *(int(each.level or 0), each.occurrence, each.is_acknowledged),
            *(hold is not None for hold in (each.suppressed_by, each.shelf, each.outage)),
        )
        for each in alarms
        if each.identity.id in ALARMS
    }


class Life:
    """A unit's alarms with their store, and a random sequence of what may happen to them."""

    def __init__(self, path: Path, seed: int, host: Any, tools: Any) -> None:
        self.random = random.Random(seed)  # noqa: S311  reproducible on purpose
        self.path, self.host, self.tools = path, host, tools
        self.is_latching = self.random.random() < 0.4
        self.rules = UnitRules(
            channel=rule_of(0.0, 0.0),
            films=rule_of(0.0, 0.0, is_latching=self.is_latching),
            clock_offset=None,
            clock_drift=None,
            time_stamps=None,
            link=rule_of(0.0, 0.0),
        )
        self.store: SqliteStore | None = None
        self.durable = dict.fromkeys(ALARMS, NEVER_RAISED)
        self.connected = False
        self.n_blocks = 0
        self._start()

    def _start(self) -> None:
        if self.store is not None:
            self.store.close()
        self.store = SqliteStore(self.path)
        self.uncertain = self.tools.uncertain(self.store)
        live = LiveView(["U1"], self.host, 30.0)
        self.recorder = Recorder(self.uncertain, live, self.host, self.path.parent)
        units = {"U1": UnitAlarms(self.tools.unit, self.rules)}
        self.engine = AlarmEngine(units, self.recorder.put, self.host)
        self.engine.restore(self.store.alarms())
        self.connected = False

    async def lead(self, n_steps: int) -> None:
        steps: list[tuple[Callable[[], Any], int]] = [
            (self.samples_arrive, 8),
            (self.link_changes, 2),
            (self.time_passes, 3),
            (self.operator_acts, 7),
            (partial(self.written, "writes"), 4),
            (self.written_while_more_arrives, 2),
            (partial(self.written, "writes_silently"), 2),
            (partial(self.written, "refuses"), 2),
            (self.crashes, 2),
            (self.stops_in_order, 1),
        ]
        todo = self.random.choices(*zip(*steps, strict=True), k=n_steps)
        for step in todo:
            done = step()
            if done is not None:
                await done
        await self.stops_in_order()
        self.check_history()

    def samples_arrive(self) -> None:
        self.n_blocks += self.random.choice([1, 1, 1, 2])  # some get lost
        is_bad = self.random.random() < 0.4
        probe = bad(Reason.SENSOR_FAILURE) if is_bad else GOOD
        block = given_block(
            unit="U1",
            epoch=1,
            first_index=self.n_blocks * 100,
            start_ns=self.n_blocks * SECOND,
            rate_hz=100.0,
            samples=np.zeros((4, 100), dtype=np.float32),
            channel_quality=(probe, GOOD, GOOD, GOOD),
            slow={},
        )
        films = {FILM: {"x": self._film()}} if self.random.random() < 0.7 else {}
        before = kept(self.engine.alarms)
        news = self.engine.take(block, [], films)
        if news:
            self.recorder.put(news)
        after = kept(self.engine.alarms)
        assert after[PROBE][0] == int(is_bad)
        for id_, condition in ((id_, found["x"]) for id_, found in films.items()):
            held = before[id_][0] if self.is_latching or not condition.is_known else 0
            assert after[id_][0] == max(held, condition.level or 0)
            assert after[id_][3] == (condition.suppressed_by is not None)

    def _film(self) -> Judgement:
        level = self.random.choice([None, None, AlarmLevel.ALERT, AlarmLevel.DANGER])
        known = Judgement(level, value=0.1 * (level or 0), limit=0.1)
        others = unknown("no_baseline"), unknown("standstill", "standstill")
        return self.random.choice([known, known, known, known, *others])

    def link_changes(self) -> None:
        self.connected = self.random.random() < 0.5
        self.engine.link("U1", self.connected, None if self.connected else "no route")
        assert kept(self.engine.alarms)[LINK][0] == int(not self.connected)

    def time_passes(self) -> None:
        self.host.step(self.random.randint(0, 10) * SECOND)
        shelves = {each.identity: each.shelf for each in self.engine.alarms if each.shelf}
        self.engine.tick()
        assert kept(self.engine.alarms)[LINK][0] == int(not self.connected)
        left = {each.identity: each.shelf for each in self.engine.alarms if each.shelf}
        assert left == {id_: s for id_, s in shelves.items() if s.until_ns > self.host.ns}

    def operator_acts(self) -> None:
        alarm = self.engine.alarm(self.random.choice(ALARMS))
        until = self.host.ns + self.random.randint(1, 20) * SECOND
        occurrence = max(0, alarm.occurrence - self.random.choice([0, 0, 0, 1]))
        actions: list[tuple[Action, bool]] = [
            (Acknowledge("A. Name", occurrence), occurrence == alarm.occurrence),
            (Shelve("A. Name", "known", until), True),
            (Unshelve("A. Name"), True),
            (TakeOutOfService("B. Name", "overhaul"), True),
            (ReturnToService("B. Name"), True),
            (Comment("A. Name", "told the shift engineer"), True),
            (Reset("A. Name"), alarm.is_latched and alarm.is_acknowledged),
        ]
        weights = [6, 2, 2, 1, 2, 1, 3]
        [(action, is_allowed)] = self.random.choices(actions, weights)
        expected = operate(alarm, action, self.host.ns)[0] if is_allowed else alarm
        try:
            self.engine.operate(alarm.identity.id, action)
        except ActionRefusedError:
            assert not is_allowed, action
        else:
            assert is_allowed, action
        assert self.engine.alarm(alarm.identity.id) == expected

    async def written_while_more_arrives(self) -> None:
        """What comes while the disk is busy is not taken for written."""
        self.uncertain.fate = "writes"
        durable = kept(self.engine.alarms)
        writing = asyncio.create_task(self.recorder.flush())
        await asyncio.sleep(0)
        self.samples_arrive()
        await writing
        self.durable = durable

    async def written(self, fate: str = "writes") -> None:
        """Let the recorder write; silently, where the append is on the disk without an answer."""
        self.uncertain.fate = fate
        await self.recorder.flush()
        if fate != "refuses":
            self.durable = kept(self.engine.alarms)

    def crashes(self) -> None:
        """What was not on the disk is gone; everything that was is there."""
        self._start()
        assert kept(self.engine.alarms) == self.durable

    async def stops_in_order(self) -> None:
        await self.written()
        self.crashes()

    def check_history(self) -> None:
        """No event lost, none doubled: numbers and states of each alarm hang together."""
        assert self.store is not None
        for id_ in ALARMS:
            query = AlarmQuery(alarm=id_, limit=10_000)
            events = [stored.event for stored in reversed(self.store.alarm_events(query))]
            assert [e.number for e in events] == list(range(1, len(events) + 1))
            states = [AlarmState.NORMAL, *(e.state_after for e in events)]
            assert [e.state_before for e in events] == states[:-1]
            announced = [e.occurrence for e in events if e.change in ANNOUNCED]
            assert announced == list(range(1, self.durable[id_][1] + 1))
            assert not _latched_twice(events)
        assert kept(self.store.alarms()) == self.durable

    def close(self) -> None:
        if self.store is not None:
            self.store.close()


def _latched_twice(events: Sequence[AlarmEvent]) -> bool:
    """Whether the same latch was told twice."""
    latches = [e.change for e in events if e.change in (*ANNOUNCED, *LATCHES)]
    pairs = pairwise(latches)
    return (AlarmChange.LATCHED, AlarmChange.LATCHED) in pairs


LATCHES = (AlarmChange.LATCHED, AlarmChange.RESET)


@pytest.mark.long
@pytest.mark.timeout(max(300, N_LIVES))
@pytest.mark.usefixtures("_quiet")
@pytest.mark.parametrize("n_lives", first_fast(1, [min(N_LIVES, 30), N_LIVES]))
async def test_no_alarm_is_lost_and_none_is_doubled(database, host, tools, n_lives):
    for seed in range(n_lives):
        life = Life(database(), seed, host, tools)
        try:
            await life.lead(N_STEPS)
        except AssertionError as error:
            raise AssertionError(f"life {seed}: {error}") from error
        finally:
            life.close()
