"""Metrics of links and samples: what each unit's device has offered, and what became of it."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence

from prometheus_client.metrics_core import Metric

from core.samples.gaps import SampleAccount
from core.units import NS_PER_S
from service.live.live_view import LinkState, LiveView
from service.runtime.metrics import counter, gauge, histogram
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
