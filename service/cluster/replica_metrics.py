"""Prometheus metrics of a replica, which is a process that only serves HTTP."""

from collections.abc import Awaitable, Callable, Sequence

from prometheus_client.process_collector import ProcessCollector

from acquisition.clock import Clock
from service.live.client import LiveClient
from service.live.metrics import add_alarms, add_films, add_units
from service.live.receivers import ReceiverView
from service.notifications.metrics import add_deliveries
from service.runtime.metrics import Families
from service.settings.plant import PlantFile
from service.store.port import StoreError

REPORTS = {
    "reports_readable": "This is 1 if the reports in the database could be read.",
    "unit_analysed": "This is 1 while a process reports on the unit.",
    "unit_silence_seconds": "This is the time since the last report of the process that analyses"
    " the unit.",
}


async def replica_metrics(
    plant: PlantFile,
    live: LiveClient,
    receivers: Callable[[], Awaitable[Sequence[ReceiverView]]],
    clock: Clock,
    store_kind: str,
) -> bytes:
    """Return the metrics of a replica and of the units reported to it, as Prometheus text.

    `receivers` returns the delivery state of all receivers of notifications; delivery metrics are
    omitted if it raises `StoreError`. `store_kind` is the kind of the database.
    """
    views: Sequence[ReceiverView] | None
    try:
        views = await receivers()
    except StoreError:
        views = None
    bearings = {unit.id: [bearing.id for bearing in unit.bearing] for unit in plant.unit}
    families, units = Families(), live.units
    families.add_program(store_kind)
    families.declare(REPORTS)
    families.add("reports_readable", units.read_error is None)
    for unit in bearings:
        families.add("unit_analysed", units.is_alive(unit), unit=unit)
        families.add("unit_silence_seconds", units.silence_s(unit), unit=unit)
    add_units(families, units, bearings)
    add_films(families, units, live.films.newest, bearings)
    add_alarms(families, live.alarms.alarms, live.alarms.count(), list(bearings))
    add_deliveries(families, views, clock.now_ns())
    families.include(ProcessCollector(registry=None))
    return families.text
