"""What is watched of the service itself, and by which limits."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from core.alarms.alarm import PLANT, AlarmIdentity, AlarmKind, AlarmRule
from core.alarms.condition_limits import ConditionLimits
from core.alarms.kinds import LimitWatch, Watch
from core.alarms.rules import rule_of
from core.limits import Limits
from service.alarms.stream_alarms import STREAM
from service.settings.alarms import AlarmSettings

STORE, SERVICE, CAPTURES, DISK = "store", "service", "captures", "disk"
"""Subjects of alarms about the service; lost samples have their unit's name."""

RECORDINGS = "recordings"

FULL_SHARE = 0.9
"""Of the queue: about to make acquisition wait."""

LOSS_MINUTES = 10
"""Time over which lost samples are counted, and for which lost results are told."""


@dataclass(frozen=True)
class ServiceRules:
    """Limits of the service.

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
    """

    store_behind: Limits = field(default_factory=lambda: Limits(10.0))
    waiting: Limits = field(default_factory=lambda: Limits(0.5, FULL_SHARE, 0.1))
    delay: Limits = field(default_factory=lambda: Limits(5.0, deadband=1.0))
    loss: Limits = field(default_factory=lambda: Limits(0.05))


def service_rules_of(alarms: AlarmSettings) -> ServiceRules:
    """Limits as the plant file has them."""
    share = alarms.max_waiting_share
    return ServiceRules(
        store_behind=Limits(max(alarms.store_failing_after_s, 0.1)),
        waiting=Limits(share, FULL_SHARE if share < FULL_SHARE else None, share / 5),
        delay=Limits(alarms.max_analysis_delay_s, deadband=alarms.max_analysis_delay_s / 5),
        loss=Limits(alarms.max_samples_lost_share),
    )


def service_watches(units: Iterable[str], rules: ServiceRules) -> dict[str, Watch]:
    """The alarms about the service, by kind; those about lost samples by unit."""
    soon, steady = rule_of(0.0, 0.0), rule_of(5.0, 30.0)
    lasting = rule_of(0.0, 60.0 * LOSS_MINUTES)
    watches: list[Watch] = [
        _limit(STORE, AlarmKind.RESULTS_NOT_STORED, soon, rules.store_behind),
        Watch(_identity(STORE, AlarmKind.RESULTS_LOST), lasting, STORE),
        _limit(SERVICE, AlarmKind.BLOCKS_WAITING, steady, rules.waiting),
        _limit(SERVICE, AlarmKind.ANALYSIS_LATE, steady, rules.delay),
        Watch(_identity(CAPTURES, AlarmKind.CAPTURES_NOT_KEPT), soon, CAPTURES),
        Watch(_identity(RECORDINGS, AlarmKind.SAMPLES_NOT_RECORDED), soon, RECORDINGS),
        Watch(_identity(RECORDINGS, AlarmKind.RECORDINGS_DAMAGED), lasting, RECORDINGS),
        Watch(_identity(SERVICE, AlarmKind.QUESTIONS_REFUSED), steady, SERVICE),
        Watch(_identity(DISK, AlarmKind.DISK_NEARLY_FULL), steady, DISK),
        Watch(_identity(STORE, AlarmKind.STORED_DATA_DAMAGED), soon, STORE),
        Watch(_identity(STREAM, AlarmKind.STREAM_AWAY), steady, STREAM),
    ]
    found = {watch.identity.kind.value: watch for watch in watches}
    lost = {unit: _limit(unit, AlarmKind.SAMPLES_LOST, soon, rules.loss) for unit in units}
    return found | {loss_key(unit): watch for unit, watch in lost.items()}


def loss_key(unit: str) -> str:
    """Where the alarm about lost samples of a unit stands among the watches."""
    return f"{AlarmKind.SAMPLES_LOST}:{unit}"


def told_by(identity: AlarmIdentity) -> str:
    """Unit whose process tells of an alarm: of lost samples, the one that analyses their unit."""
    return identity.subject if identity.kind is AlarmKind.SAMPLES_LOST else identity.unit


def _identity(subject: str, kind: AlarmKind) -> AlarmIdentity:
    return AlarmIdentity(PLANT, subject, kind)


def _limit(subject: str, kind: AlarmKind, rule: AlarmRule, limits: Limits) -> LimitWatch:
    return LimitWatch(_identity(subject, kind), rule, subject, ConditionLimits.single(limits))
