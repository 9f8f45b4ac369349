"""Metrics of the measuring process: samples, polls, queue, store and disks."""

import re
from collections.abc import Iterable, Mapping

from core.units import NS_PER_S
from service.measuring.acquirer import Bus
from service.measuring.integrity import IntegrityMonitor
from service.measuring.live_view import LiveView
from service.measuring.recorder import Recorder
from service.runtime.disk import S_PER_DAY, SpaceWatch
from service.runtime.metrics import MEASURED, Families
from service.runtime.polls import TimedSource

MAX_REASONS = 24
"""Maximum number of rejection reasons per unit; further reasons are counted as `OTHER`."""

OTHER = "other"

_WORD = re.compile(r"[a-z][a-z0-9_]{0,47}")

SAMPLES = {
    "samples_offered_total": "This counts the samples per channel that the device has counted since"
    " the first that arrived.",
    "samples_received_total": "This counts the samples per channel that arrived; they are flagged"
    " if a channel of their block was not good.",
    "samples_missing_total": "This counts the samples per channel that the device has counted and"
    " that did not arrive.",
    "samples_rejected_total": "This counts the samples per channel that were refused, by reason.",
    "samples_repeated_total": "This counts the repeated samples per channel, which were dropped.",
    "device_restarts_total": "This counts the restarts of the sample count of the device.",
    "ingest_lag_seconds": "This is the delay of the newest sample by the clock of the host.",
    "device_clock_offset_seconds": "This is the offset of the time stamps of the device from the"
    " clock of the host.",
    "frames_refused_total": "This counts the frames of a CAN bus that were not used, by reason.",
}


def add_samples(
    families: Families,
    live: LiveView,
    units: Iterable[str],
    sources: Mapping[str, TimedSource],
    now_ns: int,
) -> None:
    """Add sample counts (offered = received + missing + rejected) and poll durations by unit.

    `sources` are the timed sources by unit id; `now_ns` is the host time, ns since 1970 UTC.
    """
    families.declare(SAMPLES)
    for unit in units:
        status = live.status(unit)
        account, clock, last_ns = status.account, status.clock, status.last_sample_ns
        families.add("samples_offered_total", account.n_offered, unit=unit)
        families.add("samples_missing_total", account.n_gap, unit=unit)
        families.add("samples_repeated_total", account.n_repeated, unit=unit)
        families.add("device_restarts_total", account.n_restarts, unit=unit)
        families.add("samples_received_total", account.n_stored, unit=unit, quality="good")
        families.add("samples_received_total", account.n_flagged, unit=unit, quality="flagged")
        for reason, n in bounded(account.rejected).items():
            families.add("samples_rejected_total", n, unit=unit, reason=reason)
        lag_s = None if last_ns is None else (now_ns - last_ns) / NS_PER_S
        families.add("ingest_lag_seconds", lag_s, unit=unit)
        offset_s = None if clock is None else clock.offset_s
        families.add("device_clock_offset_seconds", offset_s, unit=unit)
    for unit, source in sources.items():
        families.include(source.polls, unit=unit)
        for reason, n in bounded(source.refused_frames).items():
            families.add("frames_refused_total", n, unit=unit, reason=reason)


def bounded(rejected: Mapping[str, int]) -> dict[str, int]:
    """Return counts by reason; invalid reasons and those after `MAX_REASONS` are `OTHER`."""
    counts: dict[str, int] = {}
    for reason, n_samples in rejected.items():
        is_label = _WORD.fullmatch(reason) and len(counts) < MAX_REASONS
        label = reason if is_label else OTHER
        counts[label] = counts.get(label, 0) + n_samples
    return counts


STORE = {
    "queue_blocks": "This is the number of blocks that wait for analysis.",
    "queue_capacity_blocks": "This is the maximum number of waiting blocks.",
    "queue_wait_seconds": "This is the waiting time of the oldest block.",
    "store_failing": "This is 1 while the store refuses writes.",
    "store_waiting_findings": "This is the number of findings that wait for the store.",
    "store_behind_seconds": "This is the time for which findings have waited without any being"
    " written.",
    "store_lost_findings_total": "This counts the findings that were not stored: dropped, or"
    " refused and parked.",
}


def add_store(families: Families, bus: Bus, recorder: Recorder, live: LiveView) -> None:
    """Add the metrics of durations, of the queue to the analysis, and of writes to the store."""
    families.declare(STORE)
    families.include(MEASURED)
    families.add("queue_blocks", bus.qsize())
    families.add("queue_capacity_blocks", bus.maxsize)
    families.add("queue_wait_seconds", bus.oldest_wait_s)
    families.add("store_failing", live.store_error is not None)
    families.add("store_waiting_findings", recorder.n_waiting)
    families.add("store_behind_seconds", recorder.behind_s)
    families.add("store_lost_findings_total", live.n_unstored)


INTEGRITY = {
    "store_damaged_rows": "This is the number of stored rows that were found damaged or missing"
    " since the start.",
    "store_rolled_back": "This is 1 if the database was older than when the service last stopped.",
    "store_mark_failing": "This is 1 while the number of the newest transaction cannot be written"
    " beside the database.",
}


def add_integrity(families: Families, found: IntegrityMonitor) -> None:
    """Add the metrics of the integrity checks of stored data."""
    families.declare(INTEGRITY)
    families.add("store_damaged_rows", found.stored.n_damaged)
    families.add("store_rolled_back", found.rolled_back is not None)
    families.add("store_mark_failing", found.stored.mark_error is not None)


DISKS = {
    "disk_free_bytes": "This is the free space of the disk.",
    "disk_size_bytes": "This is the size of the disk.",
    "disk_full_in_seconds": "This is the time until the disk is full at the pace of the last day.",
}


def add_disks(families: Families, space: SpaceWatch) -> None:
    """Add the metrics of the disks that the service writes to."""
    families.declare(DISKS)
    for disk in space.disks:
        days = disk.days_until_full
        families.add("disk_free_bytes", disk.space.free_bytes, volume=disk.name)
        families.add("disk_size_bytes", disk.space.total_bytes, volume=disk.name)
        seconds = None if days is None else S_PER_DAY * days
        families.add("disk_full_in_seconds", seconds, volume=disk.name)
