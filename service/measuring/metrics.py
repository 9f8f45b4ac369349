"""Metrics of samples, links, results, alarms, films, queue and store."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from prometheus_client.metrics_core import Metric

from core.alarms.alarm import PLANT, Alarm
from core.change.decision import Verdict
from core.change.film_judge import FilmNews
from core.limits import AlarmLevel
from core.quality import Level
from core.units import NS_PER_S
from service.live.alarm_list import HIDDEN, AlarmList
from service.live.live_view import LinkState, LiveView
from service.measuring.acquirer import Bus
from service.measuring.integrity import IntegrityMonitor
from service.measuring.recorder import Recorder
from service.measuring.timings import Timings
from service.runtime.disk import S_PER_DAY, SpaceWatch
from service.runtime.metrics import Rows, counter, gauge, histogram, plain_histogram
from service.runtime.polls import TimedSource

MAX_REASONS = 24
"""Maximum number of rejection reasons per unit; further reasons are counted as `OTHER`."""

OTHER = "other"

_WORD = re.compile(r"[a-z][a-z0-9_]{0,47}")

UNIT = ("unit",)


def sample_metrics(live: LiveView, units: Iterable[str]) -> Iterator[Metric]:
    """Yield the metrics of the sample account: offered = received + missing + rejected."""
    accounts = [((unit,), live.status(unit).account) for unit in units]
    yield counter(
        "samples_offered",
        "Samples per channel counted by the device since the first sample.",
        UNIT,
        ((unit, account.n_offered) for unit, account in accounts),
    )
    yield counter(
        "samples_received",
        "Samples per channel that arrived; flagged if a channel of their block was not good.",
        ("unit", "quality"),
        (
            ((*unit, quality), n)
            for unit, account in accounts
            for quality, n in (("good", account.n_stored), ("flagged", account.n_flagged))
        ),
    )
    yield counter(
        "samples_missing",
        "Samples per channel that the device counted but that did not arrive.",
        UNIT,
        ((unit, account.n_gap) for unit, account in accounts),
    )
    yield counter(
        "samples_rejected",
        "Samples per channel that were rejected, by reason.",
        ("unit", "reason"),
        _by_reason((unit, account.rejected) for (unit,), account in accounts),
    )
    yield counter(
        "samples_repeated",
        "Repeated samples per channel, which were dropped.",
        UNIT,
        ((unit, account.n_repeated) for unit, account in accounts),
    )
    yield counter(
        "device_restarts",
        "Restarts of the sample count of the device.",
        UNIT,
        ((unit, account.n_restarts) for unit, account in accounts),
    )


def link_metrics(
    live: LiveView, units: Sequence[str], sources: Mapping[str, TimedSource], now_ns: int
) -> Iterator[Metric]:
    """Yield the metrics of the links to the devices."""
    status = [((unit,), live.status(unit)) for unit in units]
    yield gauge(
        "link_connected",
        "1 while the device is connected.",
        UNIT,
        ((unit, its.state is LinkState.CONNECTED) for unit, its in status),
    )
    yield gauge(
        "ingest_lag_seconds",
        "Delay of the newest sample, by the clock of the host.",
        UNIT,
        (
            (unit, (now_ns - its.last_sample_ns) / NS_PER_S)
            for unit, its in status
            if its.last_sample_ns is not None
        ),
    )
    yield gauge(
        "data_age_seconds",
        "Time since the newest samples arrived.",
        UNIT,
        (((unit,), age) for unit in units if (age := live.data_age_s(unit)) is not None),
    )
    yield gauge(
        "device_clock_offset_seconds",
        "Offset of the time stamps of the device from the clock of the host.",
        UNIT,
        (
            (unit, its.clock.offset_s)
            for unit, its in status
            if its.clock is not None and its.clock.offset_s is not None
        ),
    )
    yield histogram(
        "poll_duration_seconds",
        "Duration of a poll, with decoding and delivery of its samples.",
        {unit: source.polls for unit, source in sources.items()},
    )
    yield counter(
        "frames_refused",
        "Frames of a CAN bus that were not used, by reason.",
        ("unit", "reason"),
        _by_reason((unit, source.refused_frames) for unit, source in sources.items()),
    )


def bounded(rejected: Mapping[str, int]) -> dict[str, int]:
    """Return counts by reason; invalid reasons, and those above `MAX_REASONS`, count as `OTHER`."""
    counts: dict[str, int] = {}
    for reason, n_samples in rejected.items():
        is_label = _WORD.fullmatch(reason) and len(counts) < MAX_REASONS
        label = reason if is_label else OTHER
        counts[label] = counts.get(label, 0) + n_samples
    return counts


def _by_reason(counts: Iterable[tuple[str, Mapping[str, int]]]) -> Rows:
    for unit, of_unit in counts:
        for reason, n in bounded(of_unit).items():
            yield (unit, reason), n


def result_metrics(
    timings: Timings, live: LiveView, units: Mapping[str, Sequence[str]]
) -> Iterator[Metric]:
    """Yield the metrics of results: duration, age, quality; ``units`` maps units to bearings."""
    yield histogram(
        "assessment_duration_seconds",
        "Duration of the analysis for each result of a bearing.",
        timings.assessments,
    )
    current = {
        (unit, bearing): live.current(unit, bearing)
        for unit, bearings in units.items()
        for bearing in bearings
    }
    yield gauge(
        "result_age_seconds",
        "Age of the newest result of a bearing.",
        ("unit", "bearing"),
        ((place, its.age_s) for place, its in current.items() if its.age_s is not None),
    )
    found = Counter((unit, its.quality.level) for (unit, _), its in current.items())
    yield gauge(
        "bearings",
        "Bearings by the quality of their newest result; bad without a current result.",
        ("unit", "quality"),
        (((unit, level.name.lower()), found[unit, level]) for unit in units for level in Level),
    )


def alarm_metrics(alarms: AlarmList, units: Iterable[str]) -> Iterator[Metric]:
    """Yield the metrics of alarms, counted as on the dashboard."""
    count = alarms.count()
    yield gauge(
        "alarms_active",
        "Active alarms that are not hidden, by priority; unit `plant` is the service itself.",
        ("unit", "priority"),
        _active(alarms.alarms, list(units)),
    )
    for name, meaning, number in (
        ("alarms_unacknowledged", "Alarms that are not acknowledged.", count.n_unacknowledged),
        ("alarms_hidden", "Alarms shelved, suppressed or out of service.", count.n_hidden),
        ("alarms_unjudged", "Alarms whose subject cannot be judged now.", count.n_unjudged),
    ):
        yield one(name, meaning, number)


def _active(alarms: Iterable[Alarm], units: Sequence[str]) -> Rows:
    """Yield the number of active alarms by unit and priority; unknown units count as the plant."""
    found: Counter[tuple[str, AlarmLevel]] = Counter()
    for alarm in alarms:
        if alarm.level is not None and alarm.state not in HIDDEN:
            unit = alarm.identity.unit
            found[unit if unit in units else PLANT, alarm.level] += 1
    for unit in (*units, PLANT):
        for level in AlarmLevel:
            yield (unit, level.name.lower()), found[unit, level]


def film_metrics(
    newest: Callable[[str, str], FilmNews | None], bearings: Mapping[str, Sequence[str]]
) -> Iterator[Metric]:
    """Yield the number of films by verdict.

    Parameters
    ----------
    newest
        Function that returns the newest film findings of a unit and bearing, or None.
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
        "Films, two directions of each bearing, by the newest verdict since the service started.",
        ("unit", "verdict"),
        (
            ((unit, verdict.name.lower()), found[unit, verdict])
            for unit in bearings
            for verdict in Verdict
        ),
    )


def queue_metrics(bus: Bus) -> Iterator[Metric]:
    """Yield the metrics of the queue between acquisition and analysis."""
    yield one("queue_blocks", "Blocks that wait for analysis.", bus.depth)
    yield one("queue_capacity_blocks", "Maximum number of waiting blocks.", bus.capacity)
    yield one("queue_wait_seconds", "Waiting time of the oldest block.", bus.oldest_wait_s)


def store_metrics(
    recorder: Recorder, live: LiveView, timings: Timings, kind: str | None
) -> Iterator[Metric]:
    """Yield the metrics of writes to the store."""
    yield plain_histogram(
        "store_commit_duration_seconds",
        "Duration of writing findings to the disk.",
        timings.commits,
    )
    if kind is not None:
        yield store_info(kind)
    failing = live.store_error is not None
    yield one("store_failing", "1 while the store refuses writes.", failing)
    yield one("store_waiting_findings", "Findings that wait for the store.", recorder.n_waiting)
    yield one(
        "store_behind_seconds",
        "Time since findings wait without any being written.",
        recorder.behind_s,
    )
    yield counter(
        "store_lost_findings",
        "Findings that were not stored: dropped, or refused and parked.",
        (),
        [((), live.n_unstored)],
    )


def store_info(kind: str) -> Metric:
    """Return the metric with the kind of the database as a label."""
    return gauge("store_info", "Kind of the database; always 1.", ("kind",), [((kind,), 1)])


def soundness_metrics(found: IntegrityMonitor | None) -> Iterator[Metric]:
    """Yield the metrics of the integrity checks; none without an integrity monitor."""
    if found is None:
        return
    yield one(
        "store_damaged_rows",
        "Stored rows that were found damaged or missing since the start.",
        found.n_damaged,
    )
    yield one(
        "store_rolled_back",
        "1 if the database was older than when the service last stopped.",
        found.rolled_back is not None,
    )
    yield one(
        "store_mark_failing",
        "1 while the number of the newest transaction cannot be written beside the database.",
        found.mark_error is not None,
    )


def space_metrics(space: SpaceWatch | None) -> Iterator[Metric]:
    """Yield the metrics of disk space."""
    disks = [((disk.name,), disk) for disk in (space.disks if space else ())]
    for name, meaning, rows in (
        ("disk_free_bytes", "Free space of a disk.", [(n, d.space.free_bytes) for n, d in disks]),
        ("disk_size_bytes", "Size of a disk.", [(n, d.space.total_bytes) for n, d in disks]),
        (
            "disk_full_in_seconds",
            "Time until the disk is full at the pace of the last day.",
            [
                (name, S_PER_DAY * disk.days_until_full)
                for name, disk in disks
                if disk.days_until_full is not None
            ],
        ),
    ):
        yield gauge(name, meaning, ("volume",), rows)


def one(name: str, meaning: str, number: float) -> Metric:
    """Return a gauge metric without labels."""
    return gauge(name, meaning, (), [((), number)])
