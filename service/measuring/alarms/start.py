"""The alarm engine as it starts: rules from the plant file, states from the store."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from acquisition.clock import Clock
from core.alarms.alarm import AlarmNews
from core.alarms.board import AlarmMemory
from core.alarms.rules import UnitRules, rule_of
from core.alarms.statistics import SHOWN_NS
from core.alarms.unit_alarms import UnitAlarms
from core.change.settings import FilmRules
from core.samples.blocks import SampleBlock
from service.measuring.alarms.engine import NO_MEMORIES, AlarmEngine
from service.measuring.alarms.gone_alarms import is_shared
from service.measuring.alarms.health import LookAtHealth
from service.measuring.alarms.service_alarms import ServiceAlarms
from service.measuring.alarms.service_rules import service_rules_of, told_by
from service.measuring.alarms.stream_alarms import stream_alarms
from service.measuring.plant_part import WHOLE, PlantPart
from service.measuring.recorder import Findings
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
from service.store.port import AlarmQuery, Store

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
