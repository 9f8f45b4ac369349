"""`Replica`: what a process that only serves works with; all of it comes from the database."""

from dataclasses import dataclass

from acquisition.clock import Clock
from service.api.auth.authenticator import AccessDesk
from service.api.auth.refusals import Refusals
from service.api.context import Context
from service.app.delivery import receivers_of
from service.app.ground import STALE_HOPS, refresh_s
from service.cluster.replica.alarms import ReplicaAlarms
from service.cluster.replica.asking import Asking
from service.cluster.replica.captures import NoCaptures
from service.cluster.replica.deliveries import ReplicaDeliveries
from service.cluster.replica.described import Described
from service.cluster.replica.feed import Feed
from service.cluster.replica.films import ReplicaFilms
from service.cluster.replica.live import ReplicaLive
from service.cluster.replica.metrics import ReplicaMetrics
from service.measuring.references import ReferencesInForce
from service.runtime.heartbeats import Heartbeats
from service.settings.alarm_rules import chatter_rule_of
from service.settings.core_values import machine_of
from service.settings.origin import Origin
from service.settings.plant import PlantFile
from service.store.port import Store


@dataclass(frozen=True)
class Replica:
    """A plant as its database tells of it."""

    plant: PlantFile
    store: Store
    clock: Clock
    live: ReplicaLive
    alarms: ReplicaAlarms
    films: ReplicaFilms
    feed: Feed
    references: ReferencesInForce
    deliveries: ReplicaDeliveries

    def checks(self) -> dict[str, str]:
        """Whether somebody analyses each unit, in words."""
        return {f"analysis of {unit}": self._signs_of(unit) for unit in self._units}

    @property
    def _units(self) -> list[str]:
        return [unit.id for unit in self.plant.unit]

    def _signs_of(self, unit: str) -> str:
        silence_s = self.live.silence_s(unit)
        if silence_s is None:
            return "no sign of life yet"
        said = f"last sign of life {silence_s:.1f} s ago"
        return said if self.live.is_alive(unit) else f"silent: {said}"


async def replica_on(plant: PlantFile, store: Store, clock: Clock) -> Replica:
    """Put the parts together, and know what there is before anybody asks.

    Raises
    ------
    StoreError
        If it cannot be read.
    """
    units = [unit.id for unit in plant.unit]
    live = ReplicaLive(units, clock, STALE_HOPS * refresh_s(plant))
    alarms = ReplicaAlarms(units, live.is_alive, chatter_rule_of(plant.alarms))
    films = ReplicaFilms(plant, store.films)
    feed = Feed(store, live, alarms, films, clock)
    await feed.start()
    references = ReferencesInForce(
        {unit.id: Described(machine_of(unit)) for unit in plant.unit}, store, clock
    )
    await references.look()
    receivers = receivers_of(plant, Origin.LIVE, clock)
    deliveries = ReplicaDeliveries(receivers, store.outbox)
    return Replica(plant, store, clock, live, alarms, films, feed, references, deliveries)


def replica_context(
    replica: Replica, desk: AccessDesk | None, refusals: Refusals | None, beats: Heartbeats
) -> Context:
    """What the API works with in a process that only serves."""
    plant = replica.plant
    bearings = {unit.id: [bearing.id for bearing in unit.bearing] for unit in plant.unit}
    seen = (replica.live, replica.alarms, replica.films, replica.deliveries, replica.clock)
    return Context(
        plant_name=plant.plant.name,
        units={unit.id: unit for unit in plant.unit},
        live=replica.live,
        store=replica.store,
        clock=replica.clock,
        refresh_s=refresh_s(plant),
        references=replica.references,
        alarms=replica.alarms,
        films=replica.films,
        operators=Asking(replica.store, replica.alarms, replica.clock),
        captures=NoCaptures(),
        deliveries=replica.deliveries,
        metrics=ReplicaMetrics(bearings, *seen, replica.store.kind).scrape,
        max_shelf_s=3600.0 * plant.alarms.max_shelf_h,
        loops=beats.look,
        checks=replica.checks,
        refusals=refusals,
        access=desk,
    )
