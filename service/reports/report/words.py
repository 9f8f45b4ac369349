"""What a report says, in words; nothing here is escaped yet."""

import math
from collections.abc import Iterator

from core.alarms.alarm import AlarmChange
from core.alarms.kinds import FILM_KINDS
from service.reports.document import Evidence
from service.reports.parts import BearingPart, FindingPart, ReadingPart
from service.reports.report.case import Case
from service.runtime.times import day_and_time
from service.settings.alarm_kinds import kind_words

SURE_95 = 1.96

CAUSES = {
    "film": "the oil film itself",
    "oil": "the oil or its cooling, in all films",
    "bracket_or_transducer": "the bracket or a transducer, not the film",
    "unknown": "not told apart",
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
"""Characters of what somebody wrote that a report has room for."""


def plain(name: str) -> str:
    """A name as words."""
    return name.replace("_", " ")


def shortened(text: str, longest: int = LONGEST) -> str:
    """At most so long that the page stays one page."""
    return text if len(text) <= longest else text[: longest - 1] + "…"


def headline(evidence: Evidence) -> str:
    """What and where in one line."""
    alarm = evidence.alarm
    return f"{alarm.unit} {alarm.subject}: {kind_words(alarm.kind)}"


def facts(case: Case, now: str) -> Iterator[tuple[str, str]]:
    """Name and words of each fact."""
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
        yield "Condition", condition_words(case.bearing)
    yield "Samples", SAMPLES[case.samples.value]
    yield "State now", f"{state_words(case)}; as of {now}"
    yield "Seen by", seen_words(case)


def value_words(case: Case) -> str:
    """Value and limit; of a film's change, in percent with its interval."""
    alarm, found = case.evidence.alarm, finding(case)
    if alarm.kind in FILM_KINDS and found is not None and found.change is not None:
        limit = (
            ""
            if alarm.limit is None
            else f"; limit {percent(-alarm.limit)} or {percent(alarm.limit)}"
        )
        return f"{change_words(found)} of the expected stiffness{limit}"
    if alarm.value is None:
        return "no number"
    unit = "" if alarm.value_unit in (None, "1") else f" {alarm.value_unit}"
    limit = "" if alarm.limit is None else f"; limit {alarm.limit:.4g}{unit}"
    return f"{alarm.value:.4g}{unit}{limit}"


def change_words(found: FindingPart) -> str:
    """A change in ln as percent, with its interval."""
    if found.change is None:
        return "–"
    if found.change_std is None:
        return percent(found.change)
    half = SURE_95 * found.change_std
    low, high = percent(found.change - half), percent(found.change + half)
    return f"{percent(found.change)} (95 %: {low} to {high})"


def percent(change: float) -> str:
    """A change in ln as percent."""
    return f"{100.0 * math.expm1(change):+.1f} %".replace("-", "−")


def condition_words(bearing: BearingPart) -> str:
    """Under which condition the bearing ran."""
    words = []
    if bearing.condition is not None:
        settled = "" if bearing.condition.is_settled else ", not settled"
        words.append(plain(bearing.condition.state) + settled)
    for name in CONDITION:
        reading = bearing.readings.get(name)
        if reading is not None and reading.value is not None:
            label = "e = " if name == "eccentricity_ratio" else ""
            words.append(f"{label}{number_words(reading)}")
    return ", ".join(words)


def number_words(reading: ReadingPart) -> str:
    """A number with its unit."""
    unit = "" if reading.unit == "1" else f" {reading.unit}"
    return "–" if reading.value is None else f"{reading.value:.4g}{unit}"


def state_words(case: Case) -> str:
    """Where the occurrence stands after its newest event."""
    if not case.events:
        return "its events are not in the store"
    return plain(case.events[-1].state_after.value)


def seen_words(case: Case) -> str:
    """Who has acknowledged the occurrence, and when."""
    seen = [each for each in case.events if each.change is AlarmChange.ACKNOWLEDGED]
    if not seen:
        return "nobody has acknowledged it"
    return f"{seen[-1].actor}, {day_and_time(seen[-1].time_ns)}"


def finding(case: Case) -> FindingPart | None:
    """What was said of the alarm's film."""
    film = None if case.bearing is None else case.bearing.film
    if film is None:
        return None
    return next((each for each in film.findings if each.direction == case.direction), None)


def story(case: Case) -> str:
    """What has happened, in a sentence or two."""
    found = finding(case)
    if case.evidence.alarm.kind not in FILM_KINDS or found is None or found.change is None:
        return ""
    hours = (
        ""
        if found.time_scale_h is None
        else f", averaged over {found.time_scale_h:g} running hours"
    )
    sentence = (
        f"The stiffness of the film in {case.direction} has changed by {change_words(found)}"
        f" against what it was under this condition{hours}."
    )
    cause = found.attribution
    if cause is None:
        return sentence
    if cause.cause == "unknown":
        return f"{sentence} What changed is not told apart: {cause.reason}."
    return f"{sentence} Put down to {CAUSES.get(cause.cause, plain(cause.cause))}: {cause.reason}."
