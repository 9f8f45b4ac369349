"""Report of an alarm as self-contained HTML without scripts, for one page of A4."""

from collections.abc import Iterable, Iterator, Sequence
from html import escape

from core.alarms.alarm import AlarmChange, AlarmEvent
from core.alarms.kinds import FILM_STIFFNESS
from core.stiffness.estimators import ESTIMATORS
from service.reports.case import Case
from service.reports.document import Evidence
from service.reports.figures import figures
from service.reports.parts import AXES, BearingPart, EstimatorPart, FindingPart
from service.runtime.times import day_and_time
from service.settings.alarm_kinds import kind_words

STYLE = """
@page { size: A4 portrait; margin: 9mm 10mm; }
* { box-sizing: border-box; }
html { background: #fff; }
body { margin: 0 auto; max-width: 190mm; font: 8.2pt/1.3 "Liberation Sans", Arial, sans-serif;
  color: #222; }
header { display: flex; justify-content: space-between; align-items: baseline;
  border-bottom: 1.2pt solid #222; padding-bottom: 1mm; gap: 4mm; }
h1 { font-size: 13pt; margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 8.6pt; margin: 1.6mm 0 .4mm; }
p { margin: .6mm 0; overflow-wrap: anywhere; }
.badge { font-weight: bold; padding: .4mm 2mm; border: 1.2pt solid #222; white-space: nowrap; }
.badge.alert { background: #ffd23f; }
.badge.danger { background: #c1121f; color: #fff; border-color: #c1121f; }
dl { display: grid; grid-template-columns: 18mm 1fr 18mm 1fr; gap: .3mm 2mm; margin: 1.4mm 0; }
dt { color: #666; }
dd { margin: 0; overflow-wrap: anywhere; }
.story { font-size: 9.2pt; }
.row { display: flex; gap: 3mm; align-items: flex-start; }
figure { margin: .8mm 0 0; flex: 1; min-width: 0; }
figcaption { font-size: 7.2pt; color: #444; line-height: 1.2; }
svg { display: block; width: 100%; height: auto; font: 9px "Liberation Sans", Arial, sans-serif;
  fill: #333; }
svg path { fill: none; }
.frame { stroke: #666; stroke-width: .8; }
.grid { stroke: #e3e3e3; stroke-width: .6; }
.mid { text-anchor: middle; }
.end { text-anchor: end; }
.note { font-size: 8px; fill: #555; }
svg .band { fill: #dcdcdc; stroke: none; }
.expected { stroke: #777; stroke-width: 1; stroke-dasharray: 4 2; }
.dots { stroke-linecap: round; stroke-width: 2; }
.member { stroke: #aaa; }
.unsettled { stroke: #ccc; stroke-width: 1.4; }
.today { stroke: #1f5fa8; fill: #1f5fa8; stroke-width: 1; }
.alarm { stroke: #c1121f; fill: #c1121f; stroke-width: 1.2; }
svg path.bar, svg path.at { fill: none; }
.at { stroke: #c1121f; stroke-width: 1; }
.marked { stroke: #888; stroke-width: .7; stroke-dasharray: 2 2; }
.shaft { stroke: #1f5fa8; stroke-width: .9; }
.bearing { stroke: #d07a00; stroke-width: .9; }
svg .known { fill: #1f5fa8; stroke: #fff; stroke-width: .5; }
svg .borrowed { fill: #1f5fa8; stroke: #555; stroke-width: .5; stroke-dasharray: 2 1.5; }
svg .unknown { fill: #fff; stroke: #bbb; stroke-width: .5; }
svg .own { stroke: #c1121f; stroke-width: 1.6; }
svg .strip { fill: #f3dcdc; stroke: none; }
table { border-collapse: collapse; width: 100%; font-size: 7.4pt; }
th, td { text-align: left; padding: .2mm 1.4mm .2mm 0; border-bottom: .4pt solid #ddd;
  vertical-align: top; overflow-wrap: anywhere; }
th { color: #555; font-weight: normal; }
td.n { font-variant-numeric: tabular-nums; }
footer { border-top: .6pt solid #888; margin-top: 1.4mm; padding-top: .8mm; font-size: 6.6pt;
  color: #555; overflow-wrap: anywhere; line-height: 1.25; }
@media screen { body { padding: 6mm; } }
@media print { nav { display: none; } }
"""


CAUSES = {
    "film": "the oil film itself",
    "oil": "the oil or its cooling",
    "clearance": "the clearance, by wear or a moved pad",
    "bracket": "the bracket, not the film",
    "transducer": "a transducer, not the film",
    "bracket_or_transducer": "the bracket or a transducer, not the film",
    "unknown": "undetermined",
}

SAMPLES = {
    "complete": "kept, in the bundle",
    "being_made": "being recorded",
    "lost": "lost",
    "removed": "removed to make room",
    "none": "not kept for this alarm",
}

CONDITION = ("speed_rpm", "power_mw", "eccentricity_ratio", "oil_temperature_c")

LONGEST = 160
"""Maximum length of free text in a report, in characters."""


def plain(name: str) -> str:
    """Return a name with its underscores replaced by spaces."""
    return name.replace("_", " ")


def shortened(text: str, longest: int = LONGEST) -> str:
    """Return a text cut to at most `longest` characters, so that the report fits on one page."""
    return text if len(text) <= longest else text[: longest - 1] + "…"


def facts(case: Case, now: str) -> Iterator[tuple[str, str]]:
    """Yield name and text of each fact at the top of a report.

    `now` is the time of the report as text.
    """
    evidence, alarm = case.evidence, case.evidence.alarm
    unit = evidence.unit
    where = [evidence.plant, unit.name if unit and unit.name else alarm.unit, alarm.subject]
    yield "Where", ", ".join(where)
    yield "Level", f"{(alarm.level or '').upper()}, {alarm.change}, occurrence {alarm.occurrence}"
    yield "Since", alarm.time.replace("T", " ").replace("Z", " UTC")
    yield "Value", value_words(case)
    if alarm.reason and alarm.reason != "ok" and not story(case):
        yield "Reason", plain(alarm.reason)
    if case.bearing is not None:
        yield "Condition", _condition_words(case.bearing)
    yield "Samples", SAMPLES[case.samples.value]
    newest = case.events[-1].state_after.value if case.events else "its events are not in the store"
    yield "State now", f"{plain(newest)}; as of {now}"
    yield "Seen by", _seen_words(case)


def value_words(case: Case) -> str:
    """Return value and limit of the alarm as text; for film alarms also the newest deviation.

    Without a value the text is "no number".
    """
    alarm, found = case.evidence.alarm, finding(case)
    if alarm.kind == FILM_STIFFNESS and found is not None and found.change_percent is not None:
        limit = "" if alarm.limit is None else f"; limit {percent(alarm.limit)}"
        return f"Stiffness {change_words(found)}{limit}"
    if alarm.value is None:
        return "no number"
    unit = "" if alarm.value_unit in (None, "1") else f" {alarm.value_unit}"
    limit = "" if alarm.limit is None else f"; limit {alarm.limit:.4g}{unit}"
    return f"{alarm.value:.4g}{unit}{limit}"


def _quantity_words(found: FindingPart) -> str:
    """Return the direction of a finding as text, with "c/k" if it is about that ratio."""
    return f"{found.direction}, damping over stiffness c/k" if found.is_damping else found.direction


def change_words(found: FindingPart) -> str:
    """Return the newest deviation and the confirmed mean change of a film in percent, as text.

    A dash stands for both if neither is known.
    """
    words = []
    if found.deviation_percent is not None:
        interval = found.deviation_95_percent
        known = f" (95 %: {percent(interval[0])} to {percent(interval[1])})" if interval else ""
        words.append(f"now {percent(found.deviation_percent)}{known}")
    if found.change_percent is not None:
        words.append(f"confirmed {percent(found.change_percent)}")
    return ", ".join(words) or "–"


def percent(number: float) -> str:
    """Return a number of percent as text: one decimal, with its sign."""
    return f"{number:+.1f} %".replace("-", "−")


def _condition_words(bearing: BearingPart) -> str:
    """Return operating state and condition of the bearing as text; unknown values are omitted."""
    words = []
    if bearing.condition is not None:
        settled = "" if bearing.condition.is_settled else ", not settled"
        words.append(plain(bearing.condition.state) + settled)
    for name in CONDITION:
        reading = bearing.readings.get(name)
        if reading is not None and reading.value is not None:
            label = "e = " if name == "eccentricity_ratio" else ""
            unit = "" if reading.unit == "1" else f" {reading.unit}"
            words.append(f"{label}{reading.value:.4g}{unit}")
    return ", ".join(words)


def _seen_words(case: Case) -> str:
    """Return person and time of the newest acknowledgement, or "not acknowledged", as text."""
    seen = [each for each in case.events if each.change is AlarmChange.ACKNOWLEDGED]
    if not seen:
        return "not acknowledged"
    return f"{seen[-1].actor}, {day_and_time(seen[-1].time_ns)}"


def finding(case: Case) -> FindingPart | None:
    """Return the finding about the film in the direction of the alarm; None if it is unknown."""
    film = None if case.bearing is None else case.bearing.film
    if film is None:
        return None
    own = [each for each in film.findings if each.direction == case.direction]
    return next((each for each in own if each.level), own[0] if own else None)


def story(case: Case) -> str:
    """Return a description of the stiffness change and its cause; empty for other alarms."""
    found = finding(case)
    film = None if case.bearing is None else case.bearing.film
    findings = () if film is None else film.findings
    moved = [each for each in findings if each.level and each.change_percent is not None]
    if case.evidence.alarm.kind != FILM_STIFFNESS or found is None or not moved:
        return ""
    scale_h = found.time_scale_h
    hours = "" if scale_h is None else f", averaged over {scale_h:g} running hours"
    changes = "; ".join(f"in {_quantity_words(each)} {change_words(each)}" for each in moved)
    sentence = f"Stiffness of the film against the baseline under this condition: {changes}{hours}."
    cause = found.attribution
    if cause is None:
        return sentence
    if cause.cause == "unknown":
        return f"{sentence} The cause is undetermined: {cause.reason}."
    return f"{sentence} Put down to {CAUSES.get(cause.cause, plain(cause.cause))}: {cause.reason}."


GN_PER_M = 1e9

MAX_EVENTS, MAX_ACTOR, MAX_NOTE = 6, 32, 84
"""Limits of the table of events: number of rows, and characters in two of its columns."""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return an HTML table; headings and cells are escaped."""
    head = "".join(f"<th>{escape(each)}</th>" for each in heads)
    body = "".join(
        "<tr>" + "".join(f'<td class="n">{escape(cell)}</td>' for cell in row) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _estimators_table(bearing: BearingPart) -> str:
    """Return the HTML table of all stiffness estimates; one without a value shows its reason."""
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


def _films_table(evidence: Evidence) -> str:
    """Return the HTML table of all films at the time of the alarm; empty if none was judged."""
    found = [each for each in evidence.bearings if each.film is not None]
    if not found:
        return ""
    heads = ("Film", "x", "y", "Baseline", "Put down to")
    title = "All films of the unit at that moment"
    return f"<h2>{title}</h2>" + table(heads, (_films(each) for each in found))


def _events_table(case: Case) -> str:
    """Return the HTML table of the newest `MAX_EVENTS` events of the occurrence."""
    shown = list(case.events)[-MAX_EVENTS:]
    n_more = len(case.events) - len(shown)
    title = "What has happened" + (f" ({n_more} earlier not shown)" if n_more else "")
    heads = ("Time", "Event", "By", "Reason or note")
    return f"<h2>{title}</h2>" + table(heads, (_event(each) for each in shown))


def footer(case: Case) -> str:
    """Return the footer of the report: versions, hashes and missing data."""
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
    said = (
        "; c/k ".join(_said(each) for each in findings if each.direction == axis) for axis in AXES
    )
    return [bearing.bearing, *said, version, "; ".join(sorted(causes))]


def _said(found: FindingPart) -> str:
    verdict = plain(found.verdict)
    return verdict if found.change_percent is None else f"{verdict}, {change_words(found)}"


def _estimate(found: EstimatorPart) -> tuple[str, str]:
    coherence = "–" if found.coherence is None else f"{found.coherence:.3f}"
    reading = found.stiffness
    if reading.value is None:
        return plain(reading.reason), coherence
    scale, unit = (GN_PER_M, []) if reading.unit == "N/m" else (1.0, ["k_b"])
    parts = [f"{reading.value / scale:.4f}"]
    for u in (reading.u_random, reading.u_systematic):
        parts.append("±?" if u is None else f"±{u / scale:.4f}")
    parts += unit
    doubt = "" if reading.level == "good" else f" ({plain(reading.reason)})"
    return " ".join(parts) + doubt, coherence


def _event(event: AlarmEvent) -> tuple[str, str, str, str]:
    reason = event.reason if event.actor else plain(str(event.reason))
    return (
        day_and_time(event.time_ns),
        plain(event.change.value),
        shortened(event.actor, MAX_ACTOR),
        shortened(reason, MAX_NOTE),
    )


POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
"""Content security policy of the report, as a response header and as a tag in the page."""


def report_page(case: Case, now_ns: int) -> str:
    """Return the report of an occurrence as an HTML page, made at `now_ns`, ns since 1970 UTC."""
    evidence, bearing = case.evidence, case.bearing
    alarm, level = evidence.alarm, evidence.alarm.level or "alert"
    title = escape(f"{alarm.unit} {alarm.subject}: {kind_words(alarm.kind, alarm.directions)}")
    pairs = "".join(
        f"<dt>{escape(name)}</dt><dd>{escape(shortened(words))}</dd>"
        for name, words in facts(case, day_and_time(now_ns))
    )
    body = [
        f'<header><h1>{title}</h1><span class="badge {level}">{level.upper()}</span></header>',
        f"<dl>{pairs}</dl>",
        f'<p class="story">{escape(story(case))}</p>',
        *figures(case),
        _estimators_table(bearing) if bearing is not None else "",
        _films_table(evidence),
        _events_table(case),
        footer(case),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width">'
        f"<title>{title}, {escape(evidence.alarm.time)}</title><style>{STYLE}</style></head>"
        f"<body>{''.join(body)}</body></html>\n"
    )
