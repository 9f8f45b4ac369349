"""The alarm engine as it starts: rules from the plant file, states from the store."""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from acquisition.clock import Clock
from core.alarms.unit_alarms import UnitAlarms
from service.alarms.engine import AlarmEngine
from service.alarms.rules import rules_of
from service.capture.captures import Captures
from service.conversion import machine_of
from service.origin import Origin
from service.recorder import Findings
from service.settings.plant import PlantFile
from service.store.port import Store


async def alarm_engine(
    plant: PlantFile,
    origin: Origin,
    store: Store,
    put: Callable[[Findings], None],
    clock: Clock,
    captures: Captures | None = None,
    rows: Mapping[str, Sequence[str]] = MappingProxyType({}),
) -> AlarmEngine:
    """Put the engine together and let it go on where the service stopped.

    Parameters
    ----------
    captures
        Keeps the samples around an alarm, if they are kept.
    rows
        Of units whose blocks do not have a row for each channel: which channel each row is about.

    Raises
    ------
    StoreError
        If the alarms that there were cannot be read: to start without them would lose them.
    """
    units = {
        unit.id: UnitAlarms(
            machine_of(unit), rules_of(unit, plant.alarms, origin), rows.get(unit.id)
        )
        for unit in plant.unit
    }
    engine = AlarmEngine(units, put, clock, captures.take if captures else None)
    engine.restore(await asyncio.to_thread(store.alarms))
    return engine
