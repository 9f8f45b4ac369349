"""Metrics of the measuring process, as text."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from prometheus_client.process_collector import ProcessCollector

from service.live.metrics import add_alarms, add_films, add_units
from service.measuring.acquirer import Bus
from service.measuring.metrics import add_disks, add_integrity, add_samples, add_store
from service.notifications.metrics import add_deliveries
from service.recordings.metrics import add_recordings
from service.runtime.metrics import Families
from service.runtime.polls import TimedSource
from service.store.port import StoreError

if TYPE_CHECKING:
    from service.app.measuring_process import Analysis
    from service.reports.collector import EvidenceCollector


async def measuring_metrics(
    analysis: "Analysis", bus: Bus, sources: Mapping[str, TimedSource]
) -> bytes:
    """Return all metrics of the measuring process in the Prometheus text format.

    Parameters
    ----------
    sources
        Timed sample sources by unit id.
    """
    try:
        receivers = await analysis.deliveries.look()
    except StoreError:
        receivers = None
    process, families = analysis.process, Families()
    live, now_ns = process.live, process.clock.now_ns()
    units = {unit.id: [bearing.id for bearing in unit.bearing] for unit in process.plant.unit}
    families.add_program(process.store.kind)
    add_samples(families, live, units, sources, now_ns)
    add_units(families, live, units)
    add_films(families, live, analysis.films.newest, units)
    add_alarms(families, analysis.alarms.alarms, analysis.alarms.count(), list(units))
    add_store(families, bus, analysis.recorder, live)
    add_integrity(families, analysis.soundness)
    add_disks(families, analysis.space)
    add_recordings(families, analysis.tape, analysis.captures, analysis.recordings)
    add_evidence(families, analysis.evidence)
    add_deliveries(families, receivers, now_ns)
    families.include(ProcessCollector(registry=None))
    return families.text


EVIDENCE = {
    "evidence_written_total": "This counts the bundles of evidence of alarms.",
    "evidence_failed_total": "This counts the failed attempts to write such a bundle.",
    "evidence_lost_total": "This counts the occurrences whose evidence was given up.",
    "evidence_pending": "This is the number of bundles that are still to be written.",
}


def add_evidence(families: Families, evidence: "EvidenceCollector") -> None:
    """Add the numbers of stored and failed evidence bundles."""
    families.declare(EVIDENCE)
    families.add("evidence_written_total", evidence.n_written)
    families.add("evidence_failed_total", evidence.n_failed)
    families.add("evidence_lost_total", evidence.n_lost)
    families.add("evidence_pending", evidence.n_pending)
