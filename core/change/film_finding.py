"""`FilmFinding`: what is said of a film in one direction after one reading."""

from dataclasses import dataclass

from core.change.attribution import Attribution, Cause
from core.change.decision import Decision
from core.change.settings import ChangeLimits
from core.change.verdict import JUDGED, Verdict
from core.limits import AlarmLevel, Judgement, unknown


@dataclass(frozen=True)
class FilmFinding:
    """A verdict with the numbers that it stands on; None where there are none.

    Parameters
    ----------
    level
        Level that is held, whether or not this reading could be judged.
    change, change_std, time_scale_h
        Most significant mean deviation from the baseline, in ln; its standard uncertainty, and over
        how many running hours it was averaged.
    deviation, deviation_std
        Of this reading alone; None unless it was compared.
    baseline_version
        What it was compared with.
    attribution
        What a change is put down to, while a level is held.
    """

    verdict: Verdict
    level: AlarmLevel | None = None
    change: float | None = None
    change_std: float | None = None
    time_scale_h: float | None = None
    deviation: float | None = None
    deviation_std: float | None = None
    baseline_version: int | None = None
    attribution: Attribution | None = None


CHANGED = {
    Cause.FILM: "film_changed",
    Cause.OIL: "all_films_changed",
    Cause.BRACKET_OR_TRANSDUCER: "bracket_or_transducer_changed",
    Cause.UNKNOWN: "changed_cause_unknown",
}
"""Reasons of alarms."""


def film_finding(decision: Decision, is_compared: bool, version: int | None) -> FilmFinding:
    """What a decision says.

    Parameters
    ----------
    is_compared
        Whether its newest reading was compared with the baseline.
    """
    finding = decision.finding
    return FilmFinding(
        verdict=decision.verdict,
        level=decision.level,
        change=finding.change if finding else None,
        change_std=finding.std if finding else None,
        time_scale_h=finding.time_scale_h if finding else None,
        deviation=decision.deviation if is_compared else None,
        deviation_std=decision.deviation_std if is_compared else None,
        baseline_version=version,
    )


def alarm_condition(finding: FilmFinding, limits: ChangeLimits) -> Judgement:
    """What an alarm of the film's change makes of it: what is not judged has not returned."""
    if finding.verdict not in JUDGED:
        return unknown(finding.verdict.name.lower())
    limit = limits.danger_change if finding.level is AlarmLevel.DANGER else limits.alert_change
    reason = "ok"
    if finding.level is not None:
        reason = CHANGED[finding.attribution.cause if finding.attribution else Cause.UNKNOWN]
    return Judgement(finding.level, value=finding.change, limit=limit, reason=reason)
