"""Alarms of all units: life cycle, listeners, and how they start."""

import asyncio
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import structlog

from acquisition.clock import Clock
from core.alarms.alarm import ANNOUNCED, Alarm, AlarmChange, AlarmEvent, AlarmNews
from core.alarms.board import AlarmMemory
from core.alarms.judgements import VectorReference
from core.alarms.kinds import LINK_LOST
from core.alarms.operation import Action
from core.alarms.rules import UnitRules, rule_of
from core.alarms.statistics import SHOWN_NS, ChatterRule, ChatterWatch
from core.alarms.unit_alarms import UnitAlarms
from core.change.settings import FilmRules
from core.limits import Judgement
from core.monitor.assessment import Assessment
from core.samples.blocks import SampleBlock
from service.live.alarm_board import AlarmCount, count_of
from service.measuring.recorder import Findings
from service.measuring.service_alarms import (
    HostTime,
    LookAtHealth,
    ServiceAlarms,
    ToldAlarms,
    is_shared,
    refuse,
    service_rules_of,
    stream_alarms,
    told_by,
)
from service.runtime.heartbeats import UNHEARD, Pulse
from service.settings.alarm_kinds import MESSAGES_REFUSED
from service.settings.core_values import (
    chatter_rule_of,
    film_rules_of,
    machine_of,
    references_of,
    rules_of,
)
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.settings.units import UnitSettings
from service.store.access.audit_entries import acting
from service.store.port import AlarmQuery
from service.store.store import Store

log = structlog.get_logger()

TICK_S = 0.5

NO_MEMORIES: Mapping[str, AlarmMemory] = MappingProxyType({})

NO_FILMS: Mapping[str, Judgement] = MappingProxyType({})

WITHOUT_LINK = (LINK_LOST, MESSAGES_REFUSED)
"""Kinds that are judged also while no samples arrive."""

Board = UnitAlarms | ServiceAlarms | ToldAlarms

LOGGED = (*ANNOUNCED, AlarmChange.RETURNED)


class AlarmEngine:
    """Keeps all alarms; works on the event loop and never waits.

    Parameters
    ----------
    units
        Alarms of each unit.
    put
        Takes what is to be stored.
    listener
        Told of every block with the news that it has brought.
    service
        Alarms about the service itself.
    chatter
        What counts as chattering.
    stream
        Alarms about messages of units, where these come over a stream.
    """

    def __init__(
        self,
        units: Mapping[str, UnitAlarms],
        put: Callable[[Findings], None],
        clock: Clock,
        listener: Callable[[SampleBlock, Sequence[AlarmNews]], None] | None = None,
        service: ServiceAlarms | None = None,
        chatter: ChatterRule | None = None,
        stream: ToldAlarms | None = None,
    ) -> None:
        self._units, self._put, self._clock, self._listener = units, put, clock, listener
        self._service = service or ServiceAlarms()
        self._stream = stream
        self._kept: list[ToldAlarms] = [] if stream is None else [stream]
        self.chatter_rule = chatter or ChatterRule()
        self._chatter = ChatterWatch(self.chatter_rule)
        self._time = HostTime(clock)
        self._witness: Callable[[Sequence[AlarmNews]], None] | None = None
        self.revision = 0
        """Another number as soon as anything is known otherwise of any alarm."""

    def show(self, witness: Callable[[Sequence[AlarmNews]], None]) -> None:
        """Let somebody see all news at the moment at which it comes about."""
        self._witness = witness

    def restore(
        self, alarms: Iterable[Alarm], memories: Mapping[str, AlarmMemory] = NO_MEMORIES
    ) -> None:
        """Go on where the service stopped, before anything else arrives.

        Parameters
        ----------
        memories
            What was known besides, by unit.
        """
        now_ns, found = self._clock.now_ns(), list(alarms)
        for board in self._kept:
            theirs = [alarm for alarm in found if alarm.identity.id in board]
            self._publish(board.restore(theirs, now_ns))
            found = [alarm for alarm in found if alarm.identity.id not in board]
        for unit, own in self._units.items():
            mine = [alarm for alarm in found if alarm.identity.unit == unit]
            self._publish(own.restore(mine, now_ns, memories.get(unit)))
        others = [alarm for alarm in found if alarm.identity.unit not in self._units]
        self._publish(self._service.restore(others, now_ns))

    def keep(self, board: ToldAlarms, stored: Iterable[Alarm]) -> None:
        """Take over alarms that were another process's until now, as they were stored."""
        self._kept.append(board)
        self._publish(board.restore(stored, self._clock.now_ns()))
        self.revision += 1

    def drop(self, board: ToldAlarms) -> None:
        """Leave alarms to another process."""
        self._kept.remove(board)
        self.revision += 1

    def refuse(self, unit: str, reason: str) -> None:
        """Note that a message of a unit cannot be used."""
        if self._stream is not None:
            refuse(self._stream, unit, reason)

    def is_connected(self, unit: str) -> bool:
        """Whether samples of a unit arrive, by what was said last."""
        return self._units[unit].is_connected

    def memory(self, unit: str) -> AlarmMemory:
        """What must be known of the alarms of a unit, beside their events, to go on elsewhere."""
        return self._units[unit].memory

    def recall(self, events: Iterable[AlarmEvent]) -> None:
        """Remember what alarms did lately, oldest first, to know which are chattering."""
        for event in events:
            self._chatter.note(event, event.time_ns)

    def take(
        self,
        block: SampleBlock,
        assessments: Sequence[Assessment],
        films: Mapping[str, Judgement] = NO_FILMS,
    ) -> list[AlarmNews]:
        """Take in a block and what it has taught; the news is to be stored with it.

        Parameters
        ----------
        films
            What was decided about films by it, by alarm.
        """
        own = self._units[block.unit]
        if assessments or films:
            self.revision += 1
        news = own.take(block, assessments, self._host_ns())
        news += own.films(films, block.stop_ns)
        self._tell(news)
        if self._listener is not None:
            self._listener(block, news)
        return news

    def link(self, unit: str, is_connected: bool, reason: str | None = None) -> None:
        """Note whether samples of a unit arrive."""
        self.revision += 1
        self._publish(self._units[unit].link(is_connected, reason, self._host_ns()))

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Let time pass for lost links and for what is shelved, for ever."""
        while True:
            pulse.beat(TICK_S)
            await self._clock.sleep(TICK_S)
            self.tick()

    def tick(self) -> None:
        """Look at the host's clock once."""
        now_ns = self._host_ns()
        for own in self._boards:
            self._publish(own.tick(now_ns))

    def operate(self, id_: str, action: Action) -> Alarm:
        """Do what somebody asks for; return the alarm as it is then.

        Raises
        ------
        LookupError
            If there is no such alarm.
        ActionRefusedError
            If it does not fit the alarm as it is now.
        """
        own = self._owner(id_)
        news = own.operate(id_, action, self._clock.now_ns())
        who = acting()
        self._publish([replace(told, peer=who.peer, command=who.command) for told in news])
        return own.alarm(id_)

    def alarm(self, id_: str) -> Alarm:
        """Look an alarm up. Raises `LookupError` if there is none."""
        return self._owner(id_).alarm(id_)

    def is_chattering(self, alarm: Alarm) -> bool:
        """Whether an alarm has come and gone too often until a short while ago."""
        return self._chatter.is_chattering(alarm.identity.id, self._clock.now_ns())

    def refer_to(self, reference: VectorReference) -> None:
        """Compare 1× vectors with a new reference; one of what is there no more is left alone."""
        if reference.unit in self._units:
            self._units[reference.unit].refer_to(reference)

    @property
    def alarms(self) -> list[Alarm]:
        """All alarms, whatever their state."""
        return [alarm for own in self._boards for alarm in own.alarms]

    def is_judged(self, alarm: Alarm) -> bool:
        """Whether what an alarm watches is known now; without a link nothing but the link is."""
        if alarm.identity.kind in WITHOUT_LINK:
            return True
        if alarm.identity.unit not in self._units:
            return alarm.condition.is_known
        return alarm.condition.is_known and self.is_connected(alarm.identity.unit)

    def count(self) -> AlarmCount:
        """How many alarms are on the list."""
        return count_of(self.alarms, self.is_judged)

    def _host_ns(self) -> int:
        """Host's time; where somebody has set its clock, that counts for no delay."""
        now_ns, was_set = self._time.look()
        if was_set:
            for own in self._boards:
                own.pause()
        return now_ns

    def _publish(self, news: list[AlarmNews]) -> None:
        """Store what no block has brought."""
        self._tell(news)
        if news:
            self._put(Findings(alarms=news))

    def _tell(self, news: list[AlarmNews]) -> None:
        self.revision += bool(news)
        _log(news)
        self._count(news)
        if news and self._witness is not None:
            self._witness(news)

    def _count(self, news: Iterable[AlarmNews]) -> None:
        now_ns = self._clock.now_ns()
        for told in news:
            for event in told.events:
                self._chatter.note(event, now_ns)

    @property
    def _boards(self) -> list[Board]:
        return [*self._units.values(), self._service, *self._kept]

    def _owner(self, id_: str) -> Board:
        """Who keeps an alarm, if there is one of that name."""
        for board in self._kept:
            if id_ in board:
                return board
        return self._units.get(id_.partition(":")[0], self._service)


def _log(news: Iterable[AlarmNews]) -> None:
    for told in news:
        for event in told.events:
            if event.change in LOGGED:
                _log_event(event)


def _log_event(event: AlarmEvent) -> None:
    level = event.level.name.lower() if event.level else None
    tell = log.info if event.change is AlarmChange.RETURNED else log.warning
    tell(f"alarm {event.change}", alarm=event.identity.id, level=level, reason=str(event.reason))


@dataclass(frozen=True)
class PlantPart:
    """Some units, and perhaps what is done once for all of them.

    Parameters
    ----------
    own
        Its units, where they are not all.
    elsewhere
        Units that other processes look after.
    leads
        Whether it raises alarms about the service itself, and closes those of what is in the plant
        no more: one process does.
    """

    own: frozenset[str] = frozenset()
    elsewhere: frozenset[str] = frozenset()
    leads: bool = True

    def looks_after(self, unit: str) -> bool:
        """Whether a unit, or what is called so in its place, is this process's."""
        return unit in self.own or (self.leads and unit not in self.elsewhere)


WHOLE = PlantPart()
"""The only process of a plant."""


Listener = Callable[[SampleBlock, Sequence[AlarmNews]], None]

MAX_RECALLED = 10_000
"""Most events that are looked at for chattering alarms after a restart."""


async def alarm_engine(
    plant: PlantFile,
    origin: Origin,
    store: Store,
    put: Callable[[Findings], None],
    clock: Clock,
    listener: Listener | None = None,
    rows: Mapping[str, Sequence[str]] = MappingProxyType({}),
    look: LookAtHealth | None = None,
    part: PlantPart = WHOLE,
    memories: Mapping[str, AlarmMemory] = NO_MEMORIES,
) -> AlarmEngine:
    """Put the engine together and let it go on where the service stopped.

    Parameters
    ----------
    listener
        Takes every block with what it means to alarms, where samples are kept.
    rows
        Of units whose blocks do not have a row for each channel: which channel each row is about.
    look
        How the service itself does.
    part
        What of the plant this process looks after; alarms of the rest are left to others.
    memories
        What was known of alarms besides their events, by unit, where nothing is missing since.

    Raises
    ------
    StoreError
        If the alarms that there were cannot be read: to start without them would lose them.
    """
    units = {
        unit.id: UnitAlarms(
            machine_of(unit),
            _rules(plant, unit, origin),
            rows.get(unit.id),
            references_of(unit),
        )
        for unit in plant.unit
    }
    # how a replay is served depends on the host, and is nothing that the recording tells
    seen = look if origin is Origin.LIVE else None
    service = ServiceAlarms(units, service_rules_of(plant.alarms), seen, leads=part.leads)
    chatter = chatter_rule_of(plant.alarms)
    is_alone = part == WHOLE
    stream = None if is_alone else stream_alarms(units)
    engine = AlarmEngine(units, put, clock, listener, service, chatter, stream)
    stored = await asyncio.to_thread(store.alarms)
    ours = [
        alarm
        for alarm in stored
        if part.looks_after(told_by(alarm.identity)) and (is_alone or not is_shared(alarm))
    ]
    engine.restore(ours, memories)
    for held in await asyncio.to_thread(store.order1_references.in_force):
        engine.refer_to(held.reference)
    lately = AlarmQuery(start_ns=max(0, clock.now_ns() - SHOWN_NS), limit=MAX_RECALLED)
    events = await asyncio.to_thread(store.alarm_events, lately)
    engine.recall(found.event for found in reversed(events))
    return engine


def _rules(plant: PlantFile, unit: UnitSettings, origin: Origin) -> UnitRules:
    """Of a unit; its films have an alarm where they are watched, with delays of their own."""
    is_watched = isinstance(film_rules_of(unit, plant.films), FilmRules)
    films = rule_of(0.0, 0.0, is_latching=plant.films.latching) if is_watched else None
    return replace(rules_of(unit, plant.alarms, origin), films=films)
