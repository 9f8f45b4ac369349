"""Alarm engine: updates, announces and stores all alarms, and restores them after a restart."""

import asyncio
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import structlog

from acquisition.clock import Clock
from acquisition.delivery.arrival import Arrival
from core.alarms.alarm import ANNOUNCED, Alarm, AlarmChange, AlarmNews
from core.alarms.board import AlarmBoard, AlarmMemory
from core.alarms.judgements import VectorReference
from core.alarms.kinds import LINK_LOST
from core.alarms.operation import Action
from core.alarms.rules import rule_of
from core.alarms.statistics import SHOWN_NS, ChatterRule, ChatterWatch
from core.alarms.unit_alarms import UnitAlarms
from core.change.settings import FilmRules
from core.limits import Judgement
from core.monitor.assessment import Assessment
from core.samples.blocks import SampleBlock
from service.live.alarm_list import is_shared, reporting_unit
from service.measuring.service_alarms import (
    HealthProbe,
    RefusedMessages,
    ReportedAlarms,
    ServiceAlarms,
    service_rules_of,
)
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.times import CLOCK_STEP_S
from service.settings.alarm_kinds import MESSAGES_REFUSED
from service.settings.core_values import (
    chatter_rule_of,
    film_rules_of,
    machine_of,
    references_of,
    rules_of,
)
from service.settings.plant import PlantFile
from service.settings.sources.devices import ModbusVectorSettings
from service.settings.storage import Origin
from service.store.access.audit_entries import ActedNews, acting
from service.store.port import AlarmQuery
from service.store.store import Store

log = structlog.get_logger()

TICK_S = 1.0

WITHOUT_LINK = (LINK_LOST, MESSAGES_REFUSED)
"""Alarm kinds whose conditions are known even while no samples arrive."""

LOGGED = (*ANNOUNCED, AlarmChange.RETURNED)

Listener = Callable[[SampleBlock, Sequence[AlarmNews]], None]
"""Function that receives each block, and the `AlarmNews` (changes of alarms) that it caused."""


class AlarmEngine:
    """Engine that updates, stores and announces all alarms of a process, on the event loop.

    Parameters
    ----------
    units
        Alarms of each unit, by unit id.
    put
        Function that queues changes of alarms for the store.
    listener
        Function that receives each block with the changes of alarms that it caused.
    service
        Alarms about the service itself.
    chatter
        Detection of chattering alarms, with the past alarm events.
    stream
        Alarms about refused stream messages; None if blocks do not come over a stream.
    """

    def __init__(
        self,
        units: Mapping[str, UnitAlarms],
        put: Callable[[Sequence[AlarmNews]], None],
        clock: Clock,
        listener: Listener | None = None,
        service: ServiceAlarms | None = None,
        chatter: ChatterWatch | None = None,
        stream: RefusedMessages | None = None,
    ) -> None:
        self.units, self._put, self._clock, self._listener = units, put, clock, listener
        self._service = service or ServiceAlarms()
        self._stream = stream
        self._reported: list[ReportedAlarms] = [] if stream is None else [stream]
        self._chatter = chatter or ChatterWatch(ChatterRule())
        self._looked = Arrival.now(clock)
        self._observer: Callable[[Sequence[AlarmNews]], None] | None = None

    def set_observer(self, observer: Callable[[Sequence[AlarmNews]], None]) -> None:
        """Set the function that receives the changes of alarms, in non-empty lists."""
        self._observer = observer

    def restore(
        self, alarms: Iterable[Alarm], memories: Mapping[str, AlarmMemory] = MappingProxyType({})
    ) -> None:
        """Restore stored alarms; call it before the first block.

        `memories` are the states of the alarms by unit, only of units without missing samples since
        these states were saved.
        """
        stored: dict[AlarmBoard, list[Alarm]] = defaultdict(list)
        for alarm in alarms:
            stored[self._board_of(alarm.identity.id)].append(alarm)
        kept: dict[AlarmBoard, AlarmMemory | None]
        kept = {board: memories.get(unit) for unit, board in self.units.items()}
        for board in self._boards:
            self._publish(board.restore(stored[board], self._clock.now_ns(), kept.get(board)))

    def add_alarms(self, board: ReportedAlarms, stored: Iterable[Alarm]) -> None:
        """Add a board of alarms taken over from another process; `stored` are stored alarms."""
        self._reported.append(board)
        self._publish(board.restore(stored, self._clock.now_ns()))

    def remove_alarms(self, board: ReportedAlarms) -> None:
        """Remove a board of alarms that another process takes over."""
        self._reported.remove(board)

    def refuse(self, unit: str, reason: str) -> None:
        """Raise a unit's alarm about a refused stream message; no effect without a stream."""
        if self._stream is not None:
            self._stream.refuse(unit, reason)

    def take(
        self,
        block: SampleBlock,
        assessments: Sequence[Assessment],
        films: Mapping[str, Mapping[str, Judgement]] = MappingProxyType({}),
    ) -> list[AlarmNews]:
        """Update the alarms of a unit from a block and its results; return the changes of alarms.

        `films` are the judgements for the film alarms, by alarm id and direction.
        """
        own = self.units[block.unit]
        news = own.take(block, assessments, self._host_ns())
        news += own.films(films, block.stop_ns)
        self._announce(news)
        if self._listener is not None:
            self._listener(block, news)
        return news

    def link(self, unit: str, is_connected: bool, reason: str | None = None) -> None:
        """Update the link alarm of a unit; `reason` states why it is disconnected."""
        self._publish(self.units[unit].link(is_connected, reason, self._host_ns()))

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Update the alarms that depend on time periodically, until cancelled."""
        while True:
            pulse.beat(TICK_S)
            await self._clock.sleep(TICK_S)
            self.tick()

    def tick(self) -> None:
        """Update the alarms that depend on time: lost links, service health, expired shelving."""
        now_ns = self._host_ns()
        for board in self._boards:
            self._publish(board.tick(now_ns))

    def operate(self, id_: str, action: Action) -> Alarm:
        """Apply an operator's action and return the updated alarm.

        Raises
        ------
        LookupError
            If the alarm does not exist.
        ActionRefusedError
            If the action does not fit the state of the alarm.
        """
        board, who = self._board_of(id_), acting()
        news = board.operate(id_, action, self._clock.now_ns())
        self._publish([ActedNews(n.alarm, n.events, who.peer, who.command) for n in news])
        return board.alarm(id_)

    def alarm(self, id_: str) -> Alarm:
        """Return the alarm with an id; raise `LookupError` if it does not exist."""
        return self._board_of(id_).alarm(id_)

    @property
    def chattering(self) -> set[str]:
        """Ids of the alarms that are chattering now, that is, change too often."""
        return self._chatter.chattering(self._clock.now_ns())

    def set_reference(self, reference: VectorReference) -> None:
        """Set the reference of a bearing's 1× vectors; references of unknown units are ignored."""
        if reference.unit in self.units:
            self.units[reference.unit].refer_to(reference)

    @property
    def alarms(self) -> list[Alarm]:
        """All alarms of this process, active or not."""
        return [alarm for board in self._boards for alarm in board.alarms]

    @property
    def common_alarms(self) -> list[Alarm]:
        """Alarms of the service itself, and alarms that other components reported."""
        return [alarm for board in (self._service, *self._reported) for alarm in board.alarms]

    def is_judged(self, alarm: Alarm) -> bool:
        """Return whether an alarm's condition is known; most kinds require a connected unit."""
        if alarm.identity.kind in WITHOUT_LINK:
            return True
        if alarm.identity.unit not in self.units:
            return alarm.condition.is_known
        return alarm.condition.is_known and self.units[alarm.identity.unit].is_connected

    def _host_ns(self) -> int:
        """Return the host's time; pause the alarm delays if the clock was set."""
        before, self._looked = self._looked, Arrival.now(self._clock)
        step_s = self._looked.step_s_since(before)
        if abs(step_s) > CLOCK_STEP_S:
            log.warning("the clock of this host was set", by_s=round(step_s, 3))
            for board in self._boards:
                board.pause()
        return self._looked.host_ns

    def _publish(self, news: list[AlarmNews]) -> None:
        """Announce and store changes of alarms that were not caused by a block."""
        self._announce(news)
        if news:
            self._put(news)

    def _announce(self, news: list[AlarmNews]) -> None:
        now_ns = self._clock.now_ns()
        for event in (event for each in news for event in each.events):
            self._chatter.note(event, now_ns)
            if event.change in LOGGED:
                level = event.level.name.lower() if event.level else None
                write = log.info if event.change is AlarmChange.RETURNED else log.warning
                identity, reason = event.identity.id, str(event.reason)
                write(f"alarm {event.change}", alarm=identity, level=level, reason=reason)
        if news and self._observer is not None:
            self._observer(news)

    @property
    def _boards(self) -> list[AlarmBoard]:
        return [*self.units.values(), self._service, *self._reported]

    def _board_of(self, id_: str) -> AlarmBoard:
        for board in self._reported:
            if id_ in board:
                return board
        return self.units.get(id_.partition(":")[0], self._service)


@dataclass(frozen=True)
class PlantPart:
    """Part of a plant that one process is responsible for.

    Parameters
    ----------
    own
        Ids of the units of this process; empty if it is the only process.
    elsewhere
        Ids of the units of other processes.
    leads
        Whether this process raises the alarms about the service and closes alarms of units that
        are no longer in the plant file; exactly one process leads.
    """

    own: frozenset[str] = frozenset()
    elsewhere: frozenset[str] = frozenset()
    leads: bool = True

    def looks_after(self, unit: str) -> bool:
        """Return whether this process is responsible for a unit, or for `PLANT` (no unit)."""
        return unit in self.own or (self.leads and unit not in self.elsewhere)


WHOLE = PlantPart()
"""Whole plant in one process."""

MAX_RECALLED = 10_000
"""Maximum number of events that are examined for chattering alarms after a start."""


async def alarm_engine(
    plant: PlantFile,
    origin: Origin,
    store: Store,
    put: Callable[[Sequence[AlarmNews]], None],
    clock: Clock,
    listener: Listener | None = None,
    look: HealthProbe | None = None,
    part: PlantPart = WHOLE,
    memories: Mapping[str, AlarmMemory] = MappingProxyType({}),
) -> AlarmEngine:
    """Build the alarm engine and restore the stored alarms.

    Raises `StoreError` if stored alarms cannot be read; a start without them would lose them.

    Parameters
    ----------
    plant, origin, store, clock
        Plant file, origin of the data (live or replay), store of the alarms, and host clock.
    put, listener
        Functions that queue changes for the store, and receive each block with its changes.
    look
        Function that returns the health of the service; not called during a replay.
    part
        Part of the plant that this process is responsible for.
    memories
        States of the alarms, by unit; given only for units without missing samples since these
        states were saved.
    """
    film_rule = rule_of(0.0, 0.0, is_latching=plant.films.latching)
    watched = {u.id for u in plant.unit if isinstance(film_rules_of(u, plant.films), FilmRules)}
    units = {
        unit.id: UnitAlarms(
            machine_of(unit),
            replace(
                rules_of(unit, plant.alarms, origin),
                films=film_rule if unit.id in watched else None,
            ),
            # the rows of a block of vectors are not the channels
            [row.channel for row in unit.source.rows]
            if isinstance(unit.source, ModbusVectorSettings)
            else None,
            references_of(unit),
        )
        for unit in plant.unit
    }
    # the health of a replay depends on the host, not on the recording
    probe = look if origin is Origin.LIVE else None
    service = ServiceAlarms(units, service_rules_of(plant.alarms), probe, leads=part.leads)
    recent = AlarmQuery(start_ns=max(0, clock.now_ns() - SHOWN_NS), limit=MAX_RECALLED)
    chatter, is_alone = ChatterWatch(chatter_rule_of(plant.alarms)), part == WHOLE
    for found in reversed(await asyncio.to_thread(store.alarm_events, recent)):
        chatter.note(found.event, found.event.time_ns)
    stream = None if is_alone else RefusedMessages(units)
    engine = AlarmEngine(units, put, clock, listener, service, chatter, stream)
    own = [
        alarm
        for alarm in await asyncio.to_thread(store.alarms)
        if part.looks_after(reporting_unit(alarm.identity)) and (is_alone or not is_shared(alarm))
    ]
    engine.restore(own, memories)
    for stored in await asyncio.to_thread(store.order1_references.in_force):
        engine.set_reference(stored.reference)
    return engine
