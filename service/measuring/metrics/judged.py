"""Metrics of results, alarms and films: what is known of the plant, as counts."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from prometheus_client.metrics_core import Metric

from core.alarms.alarm import PLANT, Alarm, AlarmState
from core.change.decision import Verdict
from core.change.film_judge import FilmNews
from core.limits import AlarmLevel
from core.quality import Level
from service.live.alarm_board import AlarmBoard
from service.live.live_view import LiveView
from service.measuring.metrics.timings import Timings
from service.runtime.metrics import Rows, gauge, histogram

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


def alarm_metrics(alarms: AlarmBoard, units: Iterable[str]) -> Iterator[Metric]:
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
