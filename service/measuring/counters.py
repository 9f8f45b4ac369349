"""Metrics of samples, links, results, alarms, films, queue and store."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from prometheus_client.metrics_core import Metric

from core.alarms.alarm import PLANT, Alarm, AlarmState
from core.change.decision import Verdict
from core.change.film_judge import FilmNews
from core.limits import AlarmLevel
from core.quality import Level
from core.samples.gaps import SampleAccount
from core.units import NS_PER_S
from service.live.alarm_list import AlarmList
from service.live.live_view import LinkState, LiveView
from service.measuring.acquirer import Bus
from service.measuring.recorder import Recorder
from service.measuring.soundness import IntegrityMonitor
from service.measuring.timings import Timings
from service.runtime.disk import S_PER_DAY, SpaceWatch
from service.runtime.metrics import Rows, counter, gauge, histogram, plain_histogram
from service.runtime.polls import TimedSource

MAX_REASONS = 24
"""Per unit; what is refused for any further reason is counted as `OTHER`."""

OTHER = "other"

_WORD = re.compile(r"[a-z][a-z0-9_]{0,47}")

UNIT = ("unit",)


def sample_metrics(live: LiveView, units: Iterable[str]) -> Iterator[Metric]:
    """The account of samples: offered = received + missing + rejected."""
    accounts = {unit: live.status(unit).account for unit in units}
    yield counter(
        "samples_offered",
        "Samples per channel that the device has counted since the first one that arrived.",
        UNIT,
        (((unit,), account.n_offered) for unit, account in accounts.items()),
    )
    yield counter(
        "samples_received",
        "Samples per channel that arrived; flagged if a channel of their block was not good.",
        ("unit", "quality"),
        (row for unit, account in accounts.items() for row in _received(unit, account)),
    )
    yield counter(
        "samples_missing",
        "Samples per channel that the device has counted and nobody delivered.",
        UNIT,
        (((unit,), account.n_gap) for unit, account in accounts.items()),
    )
    yield counter(
        "samples_rejected",
        "Samples per channel that were refused, by reason.",
        ("unit", "reason"),
        (
            ((unit, reason), n)
            for unit, account in accounts.items()
            for reason, n in bounded(account.rejected).items()
        ),
    )
    yield counter(
        "samples_repeated",
        "Samples per channel that were offered a second time and dropped.",
        UNIT,
        (((unit,), account.n_repeated) for unit, account in accounts.items()),
    )
    yield counter(
        "device_restarts",
        "How often the device began to count its samples anew.",
        UNIT,
        (((unit,), account.n_restarts) for unit, account in accounts.items()),
    )


def link_metrics(
    live: LiveView, units: Sequence[str], sources: Mapping[str, TimedSource], now_ns: int
) -> Iterator[Metric]:
    """How samples come in."""
    status = {unit: live.status(unit) for unit in units}
    yield gauge(
        "link_connected",
        "1 while the device is connected.",
        UNIT,
        (((unit,), status[unit].state is LinkState.CONNECTED) for unit in units),
    )
    yield gauge(
        "ingest_lag_seconds",
        "How far the newest sample's time is behind the host's clock.",
        UNIT,
        (
            ((unit,), (now_ns - its.last_sample_ns) / NS_PER_S)
            for unit, its in status.items()
            if its.last_sample_ns is not None
        ),
    )
    yield gauge(
        "data_age_seconds",
        "Since samples arrived last.",
        UNIT,
        (((unit,), age) for unit in units if (age := live.data_age_s(unit)) is not None),
    )
    yield gauge(
        "device_clock_offset_seconds",
        "How far the device's time stamps are ahead of the host's clock.",
        UNIT,
        (
            ((unit,), its.clock.offset_s)
            for unit, its in status.items()
            if its.clock is not None and its.clock.offset_s is not None
        ),
    )
    yield histogram(
        "poll_duration_seconds",
        "What a poll took, with decoding and handing over what it brought.",
        {unit: source.polls for unit, source in sources.items()},
    )
    yield counter(
        "frames_refused",
        "Frames of a CAN bus that were not used, by reason.",
        ("unit", "reason"),
        (
            ((unit, reason), n)
            for unit, source in sources.items()
            for reason, n in bounded(source.refused_frames).items()
        ),
    )


def bounded(rejected: Mapping[str, int]) -> dict[str, int]:
    """Counts by reason with a bounded number of reasons, whatever a recording calls them."""
    counts: dict[str, int] = {}
    for reason, n_samples in rejected.items():
        is_label = _WORD.fullmatch(reason) and len(counts) < MAX_REASONS
        label = reason if is_label else OTHER
        counts[label] = counts.get(label, 0) + n_samples
    return counts


def _received(unit: str, account: SampleAccount) -> Iterator[tuple[tuple[str, str], float]]:
    yield (unit, "good"), account.n_stored
    yield (unit, "flagged"), account.n_flagged


HIDDEN = (AlarmState.SHELVED, AlarmState.SUPPRESSED, AlarmState.OUT_OF_SERVICE)


def result_metrics(
    timings: Timings, live: LiveView, units: Mapping[str, Sequence[str]]
) -> Iterator[Metric]:
    """Whether there are results, and how good they are.

    Parameters
    ----------
    units
        Bearings of each.
    """
    yield histogram(
        "assessment_duration_seconds",
        "What the analysis took for each result of a bearing.",
        timings.assessments,
    )
    current = {
        (unit, bearing): live.current(unit, bearing)
        for unit, bearings in units.items()
        for bearing in bearings
    }
    yield gauge(
        "result_age_seconds",
        "Since the newest result of a bearing.",
        ("unit", "bearing"),
        ((place, its.age_s) for place, its in current.items() if its.age_s is not None),
    )
    found = Counter((unit, its.quality.level) for (unit, _), its in current.items())
    yield gauge(
        "bearings",
        "Bearings by the quality of what is known of them now; bad without a current result.",
        ("unit", "quality"),
        (((unit, level.name.lower()), found[unit, level]) for unit in units for level in Level),
    )


def alarm_metrics(alarms: AlarmList, units: Iterable[str]) -> Iterator[Metric]:
    """Alarms on the list, as the dashboard counts them."""
    count = alarms.count()
    yield gauge(
        "alarms_active",
        "Active alarms that are not hidden, by priority; unit `plant` is the service itself.",
        ("unit", "priority"),
        _active(alarms.alarms, list(units)),
    )
    numbers = (
        ("alarms_unacknowledged", "Alarms that nobody has acknowledged.", count.n_unacknowledged),
        ("alarms_hidden", "Alarms shelved, suppressed or out of service.", count.n_hidden),
        ("alarms_unjudged", "Alarms whose subject cannot be judged now.", count.n_unjudged),
    )
    for name, meaning, number in numbers:
        yield gauge(name, meaning, (), [((), number)])


def film_metrics(
    newest: Callable[[str, str], FilmNews | None], bearings: Mapping[str, Sequence[str]]
) -> Iterator[Metric]:
    """What was said of films last, by word.

    Parameters
    ----------
    newest
        Of a unit's bearing; None before its first reading.
    """
    found = Counter(
        (unit, finding.verdict)
        for unit, its in bearings.items()
        for bearing in its
        if (news := newest(unit, bearing)) is not None
        for finding in news.findings
    )
    yield gauge(
        "films",
        "Films, two directions of each bearing, by what was said last since the service started.",
        ("unit", "verdict"),
        (
            ((unit, verdict.name.lower()), found[unit, verdict])
            for unit in bearings
            for verdict in Verdict
        ),
    )


def _active(alarms: Iterable[Alarm], units: Sequence[str]) -> Rows:
    """Those of units that are in the plant file no longer count for the plant."""
    found: Counter[tuple[str, AlarmLevel]] = Counter()
    for alarm in alarms:
        if alarm.level is not None and alarm.state not in HIDDEN:
            unit = alarm.identity.unit
            found[unit if unit in units else PLANT, alarm.level] += 1
    for unit in (*units, PLANT):
        for level in AlarmLevel:
            yield (unit, level.name.lower()), found[unit, level]


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


def soundness_metrics(found: IntegrityMonitor | None) -> Iterator[Metric]:
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
