"""Metrics of what waits and what is written: queue, store, captures, evidence."""

from collections.abc import Iterator

from prometheus_client.metrics_core import Metric

from service.live.live_view import LiveView
from service.measuring.bus import Bus
from service.measuring.metrics.timings import Timings
from service.measuring.recorder import Recorder
from service.measuring.soundness import Soundness
from service.runtime.disk import S_PER_DAY, SpaceWatch
from service.runtime.metrics import counter, gauge, plain_histogram


def queue_metrics(bus: Bus) -> Iterator[Metric]:
    """Blocks on their way from acquisition to analysis."""
    yield one("queue_blocks", "Blocks that wait for analysis.", bus.depth)
    yield one("queue_capacity_blocks", "Most blocks that can wait for it.", bus.capacity)
    yield one(
        "queue_wait_seconds", "For how long the oldest of them has waited.", bus.oldest_wait_s
    )


def store_metrics(
    recorder: Recorder, live: LiveView, timings: Timings, kind: str | None
) -> Iterator[Metric]:
    """Whether results reach the disk."""
    yield plain_histogram(
        "store_commit_duration_seconds",
        "What it took to write findings to the disk.",
        timings.commits,
    )
    if kind is not None:
        yield store_info(kind)
    failing = live.store_error is not None
    yield one("store_failing", "1 while the store refuses what is written.", failing)
    yield one("store_waiting_findings", "Findings that wait for the store.", recorder.n_waiting)
    yield one(
        "store_behind_seconds",
        "For how long findings have waited without any being written.",
        recorder.behind_s,
    )
    yield counter(
        "store_lost_findings",
        "Findings that the store did not take: given up, or refused and parked.",
        (),
        [((), live.n_unstored)],
    )


def store_info(kind: str) -> Metric:
    """Which database it is."""
    return gauge("store_info", "1; the database that results are in.", ("kind",), [((kind,), 1)])


def soundness_metrics(found: Soundness | None) -> Iterator[Metric]:
    """Whether what is stored is what was stored; nothing where nobody looks."""
    if found is None:
        return
    yield one(
        "store_damaged_rows",
        "Stored rows that were found damaged or missing since the start.",
        found.n_damaged,
    )
    yield one(
        "store_rolled_back",
        "1 if the database was not the one that was here last when the service started.",
        found.rolled_back is not None,
    )
    yield one(
        "store_mark_failing",
        "1 while it cannot be noted beside the database what the newest transaction is.",
        found.mark_error is not None,
    )


def space_metrics(space: SpaceWatch | None) -> Iterator[Metric]:
    """Room on the disks; that of a disk which nobody has looked at yet is left out."""
    disks = space.disks if space else ()
    fills = [((disk.name,), disk.days_until_full) for disk in disks]
    rows = (
        ("disk_free_bytes", "Room left on a disk.", [d.space.free_bytes for d in disks]),
        ("disk_size_bytes", "Room on it altogether.", [d.space.total_bytes for d in disks]),
    )
    for name, meaning, numbers in rows:
        by_disk = zip([(disk.name,) for disk in disks], numbers, strict=True)
        yield gauge(name, meaning, ("volume",), by_disk)
    yield gauge(
        "disk_full_in_seconds",
        "After which time it will be full at the pace of the last day.",
        ("volume",),
        [(name, S_PER_DAY * days) for name, days in fills if days is not None],
    )


def one(name: str, meaning: str, number: float) -> Metric:
    """A gauge without labels."""
    return gauge(name, meaning, (), [((), number)])
