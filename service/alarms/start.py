"""The alarm engine as it starts: rules from the plant file, states from the store."""

import asyncio
from collections.abc import Callable, Mapping

from acquisition.clock import Clock
from core.alarms.unit_alarms import UnitAlarms
from core.monitor import UnitMonitor
from service.alarms.engine import AlarmEngine
from service.alarms.rules import rules_of
from service.origin import Origin
from service.recorder import Findings
from service.settings.plant import PlantFile
from service.store.port import Store


async def alarm_engine(
    plant: PlantFile,
    monitors: Mapping[str, UnitMonitor],
    origin: Origin,
    store: Store,
    put: Callable[[Findings], None],
    clock: Clock,
) -> AlarmEngine:
    """Put the engine together and let it go on where the service stopped.

    Raises
    ------
    StoreError
        If the alarms that there were cannot be read: to start without them would lose them.
    """
    units = {
        unit.id: UnitAlarms(monitors[unit.id].unit, rules_of(unit, plant.alarms, origin))
        for unit in plant.unit
    }
    engine = AlarmEngine(units, put, clock)
    engine.restore(await asyncio.to_thread(store.alarms))
    return engine
