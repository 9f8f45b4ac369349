"""Rules of the alarms about the service itself."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from core.alarms.alarm import PLANT, AlarmIdentity, AlarmRule
from core.alarms.kinds import Watch, watch
from core.alarms.rules import LimitRule, rule_of
from core.limits import Limits
from service.settings.alarm_kinds import MESSAGES_REFUSED, SAMPLES_LOST, SERVICE_KINDS, UNIT
from service.settings.alarms import AlarmSettings

FULL_SHARE = 0.9
"""Of the queue: about to make acquisition wait."""

LOSS_MINUTES = 10
"""Time over which lost samples are counted, and for which lost results are told."""

AT_ONCE, STEADY = rule_of(0.0, 0.0), rule_of(5.0, 30.0)


@dataclass(frozen=True)
class ServiceRules:
    """Rules of the service's own alarms.

    Parameters
    ----------
    store_behind
        How long results may wait for the store, s.
    waiting
        How far the queue to the analysis may be filled.
    delay
        How long samples may wait in it, s.
    loss
        Share of a unit's samples that may get lost in ten minutes.
    at_once, steady, lasting
        Of alarms without limits: without delay, delayed, and lasting for ten minutes.
    """

    store_behind: LimitRule = field(default_factory=lambda: LimitRule(Limits(10.0), AT_ONCE))
    waiting: LimitRule = field(
        default_factory=lambda: LimitRule(Limits(0.5, FULL_SHARE, 0.1), STEADY)
    )
    delay: LimitRule = field(default_factory=lambda: LimitRule(Limits(5.0, deadband=1.0), STEADY))
    loss: LimitRule = field(default_factory=lambda: LimitRule(Limits(0.05), AT_ONCE))
    at_once: AlarmRule = AT_ONCE
    steady: AlarmRule = STEADY
    lasting: AlarmRule = field(default_factory=lambda: rule_of(0.0, 60.0 * LOSS_MINUTES))


def service_rules_of(alarms: AlarmSettings) -> ServiceRules:
    """Rules as the plant file has them."""
    share, delay_s = alarms.max_waiting_share, alarms.max_analysis_delay_s
    waiting = Limits(share, FULL_SHARE if share < FULL_SHARE else None, share / 5)
    return ServiceRules(
        store_behind=LimitRule(Limits(max(alarms.store_failing_after_s, 0.1)), AT_ONCE),
        waiting=LimitRule(waiting, STEADY),
        delay=LimitRule(Limits(delay_s, deadband=delay_s / 5), STEADY),
        loss=LimitRule(Limits(alarms.max_samples_lost_share), AT_ONCE),
    )


def service_watches(units: Iterable[str], rules: ServiceRules) -> dict[str, Watch]:
    """The alarms about the service, by kind; those about lost samples by unit.

    Refused messages and units without analysis are judged elsewhere, by unit.
    """
    subjects = {
        kind.name: (kind.subject, kind)
        for kind in SERVICE_KINDS.values()
        if kind.subject != UNIT and kind.name != MESSAGES_REFUSED
    }
    subjects |= {loss_key(unit): (unit, SERVICE_KINDS[SAMPLES_LOST]) for unit in units}
    return {
        key: watch(AlarmIdentity(PLANT, subject, kind.name), getattr(rules, kind.rule), subject)
        for key, (subject, kind) in subjects.items()
    }


def loss_key(unit: str) -> str:
    """Key of the alarm about lost samples of a unit among the watches."""
    return f"{SAMPLES_LOST}:{unit}"


def told_by(identity: AlarmIdentity) -> str:
    """Unit whose process tells of an alarm: of lost samples, the one that analyses their unit."""
    return identity.subject if identity.kind == SAMPLES_LOST else identity.unit
