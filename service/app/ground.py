"""`Ground`: what all roles of one process stand on."""

from dataclasses import dataclass

from acquisition.clock import Clock
from service.live.live_view import LiveView
from service.measuring.timings import Timings
from service.runtime.heartbeats import Heartbeats
from service.settings.core_values import analysis_of
from service.settings.modbus_sources import ModbusVectorSettings
from service.settings.origin import Origin
from service.settings.plant import PlantFile
from service.store.port import Store

STALE_HOPS = 2.5
"""A result older than this many refreshes is no longer current."""


@dataclass(frozen=True)
class Ground:
    """A plant, its store, and what is known of it now.

    Parameters
    ----------
    origin
        What the store holds, and what all answers say.
    beats
        Listens to every loop of the process.
    """

    plant: PlantFile
    origin: Origin
    clock: Clock
    store: Store
    live: LiveView
    beats: Heartbeats
    timings: Timings

    @property
    def refresh_s(self) -> float:
        """Seconds from one result to the next, of the slowest unit."""
        return refresh_s(self.plant)


def live_view(plant: PlantFile, clock: Clock) -> LiveView:
    """What is known of a plant of which nothing has been heard."""
    return LiveView([unit.id for unit in plant.unit], clock, STALE_HOPS * refresh_s(plant))


def refresh_s(plant: PlantFile) -> float:
    """Seconds from one result to the next, of a plant's slowest unit."""
    hop_samples = analysis_of(plant.analysis).hop_samples
    return max(
        (unit.source.hop_polls if isinstance(unit.source, ModbusVectorSettings) else hop_samples)
        / unit.sampling_hz
        for unit in plant.unit
    )
