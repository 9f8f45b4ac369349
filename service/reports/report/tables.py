"""The tables of a report; everything that comes from outside is escaped here."""

from collections.abc import Iterable, Sequence
from html import escape

from core.alarms.alarm import AlarmEvent
from core.stiffness.estimators import ESTIMATORS
from service.reports.document import Evidence
from service.reports.parts import AXES, BearingPart, EstimatorPart, FindingPart, ReadingPart
from service.reports.report.case import Case
from service.reports.report.words import CAUSES, change_words, plain, shortened
from service.runtime.times import day_and_time

GN_PER_M = 1e9

MAX_EVENTS, MAX_ACTOR, MAX_NOTE = 6, 32, 84
"""That a page has room for: lines, and characters in one."""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of words."""
    head = "".join(f"<th>{escape(each)}</th>" for each in heads)
    body = "".join(
        "<tr>" + "".join(f'<td class="n">{escape(cell)}</td>' for cell in row) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def estimators_table(bearing: BearingPart) -> str:
    """All estimators side by side."""
    heads = ["Estimator"]
    for axis in AXES:
        heads += [f"k {axis}, GN/m (± random ± systematic, std)", f"coherence {axis}"]
    rows = []
    for name in ESTIMATORS:
        own = [each for each in bearing.estimators if each.estimator == name]
        row = [ESTIMATORS[name].label + (", watched" if any(e.is_watched for e in own) else "")]
        for axis in AXES:
            row += [cell for each in own if each.direction == axis for cell in _estimate(each)]
        rows.append(row)
    words = f"Estimates of {bearing.bearing}, evidence: {plain(bearing.evidence)}"
    return f"<h2>{escape(words)}</h2>" + table(heads, rows)


def films_table(evidence: Evidence) -> str:
    """What was said of the films of all bearings at that moment."""
    found = [each for each in evidence.bearings if each.film is not None]
    if not found:
        return ""
    heads = ("Film", "x", "y", "Baseline", "Put down to")
    title = "All films of the unit at that moment"
    return f"<h2>{title}</h2>" + table(heads, (_films(each) for each in found))


def events_table(case: Case) -> str:
    """What has happened to the occurrence, and who did it."""
    shown = list(case.events)[-MAX_EVENTS:]
    n_more = len(case.events) - len(shown)
    title = "What has happened" + (f" ({n_more} earlier not shown)" if n_more else "")
    heads = ("Time", "Event", "By", "Reason or note")
    return f"<h2>{title}</h2>" + table(heads, (_event(each) for each in shown))


def footer(case: Case) -> str:
    """Versions and hashes."""
    evidence, found = case.evidence, case.comparison
    baseline = None if found is None else found.baseline
    words = [f"configuration {evidence.configuration}"]
    if baseline is not None:
        words.append(
            f"baseline version {baseline.version} by {baseline.author}, learned"
            f" {baseline.learned_from[:10]} to {baseline.learned_until[:10]}"
        )
    words += [f"evidence {evidence.sha256}", evidence.made_by, f"noted {evidence.taken}"]
    if evidence.origin == "replay":
        words.append("REPLAY of a recording")
    words += [f"missing: {each}" for each in evidence.missing]
    safe = " · ".join(escape(shortened(each)) for each in words)
    note = "padwatch is a condition-monitoring service and no protection system."
    return f"<footer>{safe} · {note}</footer>"


def _films(bearing: BearingPart) -> list[str]:
    findings = bearing.film.findings if bearing.film else []
    versions = {each.baseline_version for each in findings}
    causes = {
        CAUSES.get(each.attribution.cause, plain(each.attribution.cause))
        for each in findings
        if each.attribution is not None
    }
    version = ", ".join("none" if each is None else str(each) for each in versions)
    return [bearing.bearing, *map(_said, findings), version, "; ".join(sorted(causes))]


def _said(found: FindingPart) -> str:
    verdict = plain(found.verdict)
    return verdict if found.change is None else f"{verdict}, {change_words(found)}"


def _estimate(found: EstimatorPart) -> tuple[str, str]:
    coherence = "–" if found.coherence is None else f"{found.coherence:.3f}"
    return _stiffness(found.stiffness), coherence


def _stiffness(reading: ReadingPart) -> str:
    if reading.value is None:
        return plain(reading.reason)
    parts = [f"{reading.value / GN_PER_M:.4f}"]
    for u in (reading.u_random, reading.u_systematic):
        parts.append("±?" if u is None else f"±{u / GN_PER_M:.4f}")
    doubt = "" if reading.level == "good" else f" ({plain(reading.reason)})"
    return " ".join(parts) + doubt


def _event(event: AlarmEvent) -> tuple[str, str, str, str]:
    reason = event.reason if event.actor else plain(str(event.reason))
    return (
        day_and_time(event.time_ns),
        plain(event.change.value),
        shortened(event.actor, MAX_ACTOR),
        shortened(reason, MAX_NOTE),
    )
