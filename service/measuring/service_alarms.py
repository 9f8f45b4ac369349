"""Alarms about the service itself, silent units and refused stream messages."""

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from core.alarms.alarm import PLANT, Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.board import AlarmBoard, AlarmMemory
from core.alarms.kinds import Watch, watch
from core.alarms.rules import LimitRule, rule_of
from core.condition.cells import NOWHERE_KNOWN
from core.limits import WITHIN, AlarmLevel, Judgement, Limits
from core.quality import Reading
from core.samples.gaps import SampleAccount
from core.units import NS_PER_S
from service.settings.alarm_kinds import (
    ANALYSIS_GONE,
    DANGER_KINDS,
    MESSAGES_REFUSED,
    SAMPLES_LOST,
    SERVICE_KINDS,
    STREAM,
    UNIT,
)
from service.settings.alarms import AlarmSettings


@dataclass(frozen=True)
class ServiceHealth:
    """Health of the service at one time.

    Parameters
    ----------
    readings
        Readings by their names in the table of alarm kinds: a number to compare with limits, or
        the text of a fault; None if unknown or without fault.
    store_error
        Reason why the store refused the newest write; None if it was accepted.
    store_behind_s
        Time for which queued findings have waited without a successful write, s.
    n_unstored, unstored_reason
        Number of findings since the start that were not stored, and the newest reason.
    n_recordings_damaged
        Number of recordings found damaged or missing since the start.
    accounts
        Sample account of each unit that has sent samples since the start.
    disk
        Function from the previous alarm level to the judgement of the fullest disk.
    """

    readings: Mapping[str, float | str | None] = field(default_factory=dict)
    store_error: str | None = None
    store_behind_s: float = 0.0
    n_unstored: int = 0
    unstored_reason: str | None = None
    n_recordings_damaged: int = 0
    accounts: Mapping[str, SampleAccount] = field(default_factory=dict)
    disk: Callable[[AlarmLevel | None], Judgement] = lambda _: WITHIN


HealthProbe = Callable[[], ServiceHealth]


FULL_SHARE = 0.9
"""Filled fraction of the queue above which the alarm is a danger: acquisition will soon wait."""

LOSS_MINUTES = 10
"""Window of the fraction of lost samples, and off-delay of alarms about lost results, minutes."""

AT_ONCE, STEADY = rule_of(0.0, 0.0), rule_of(5.0, 30.0)


ServiceRules = Mapping[str, AlarmRule | LimitRule]
"""Rules of the alarms about the service by name."""


def service_rules_of(alarms: AlarmSettings) -> ServiceRules:
    """Return the rules of the alarms about the service from the alarm settings of the plant file.

    `store_behind` limits the time for which results wait for the store, s; `waiting` the filled
    fraction of the queue to the analysis; `delay` the waiting time of samples in the queue, s;
    `loss` the fraction of lost samples of a unit in ten minutes. The other rules have no limits,
    but an on-delay and off-delay of 0 s and 0 s; 5 s and 30 s; 0 s and ten minutes.
    """
    share, delay_s = alarms.max_waiting_share, alarms.max_analysis_delay_s
    waiting = Limits(share, FULL_SHARE if share < FULL_SHARE else None, share / 5)
    return {
        "store_behind": LimitRule(Limits(max(alarms.store_failing_after_s, 0.1)), AT_ONCE),
        "waiting": LimitRule(waiting, STEADY),
        "delay": LimitRule(Limits(delay_s, deadband=delay_s / 5), STEADY),
        "loss": LimitRule(Limits(alarms.max_samples_lost_share), AT_ONCE),
        "at_once": AT_ONCE,
        "steady": STEADY,
        "lasting": rule_of(0.0, 60.0 * LOSS_MINUTES),
    }


def loss_key(unit: str) -> str:
    """Return the key of the alarm about lost samples of a unit."""
    return f"{SAMPLES_LOST}:{unit}"


LOSS_NS = 60 * LOSS_MINUTES * NS_PER_S

LOOK_EVERY_NS = 10 * NS_PER_S


class SampleLoss:
    """Fraction of a unit's samples that were lost or rejected in the last ten minutes.

    Repeated samples count as lost if they outnumber new samples: only a device that restarts its
    sample count with its clock set back repeats samples for minutes.
    """

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int, int, int]] = deque()

    def share(self, account: SampleAccount, now_ns: int) -> float:
        """Add the present sample counts; return the fraction lost in ten minutes, 0 to 1.

        `now_ns` is the time of the counts by the host clock, ns since 1970 UTC.
        """
        offered = account.n_offered
        lost = account.n_gap + sum(account.rejected.values())
        if self._seen and offered < self._seen[-1][1]:
            self._seen.clear()  # the account was restarted
        if not self._seen or now_ns - self._seen[-1][0] >= LOOK_EVERY_NS:
            self._seen.append((now_ns, offered, lost, account.n_repeated))
        while len(self._seen) > 1 and now_ns - self._seen[0][0] > LOSS_NS:
            self._seen.popleft()
        _, offered_then, lost_then, repeated_then = self._seen[0]
        n_new, n_repeated = offered - offered_then, account.n_repeated - repeated_then
        n_dropped = n_repeated if n_repeated > n_new else 0
        return (lost - lost_then + n_dropped) / max(n_new + n_dropped, 1)

    def is_complete(self, now_ns: int) -> bool:
        """Return whether ten minutes, less one update period, have been observed."""
        return bool(self._seen) and now_ns - self._seen[0][0] >= LOSS_NS - LOOK_EVERY_NS


class ServiceAlarms(AlarmBoard):
    """Alarms about the service, and alarms of units that are no longer in the plant file.

    Parameters
    ----------
    units
        Ids of the units with an alarm about lost samples.
    rules
        Rules of the alarms.
    look
        Function that returns the health of the service; None disables the alarms.
    leads
        Whether this process evaluates the alarms of the whole plant; each process evaluates the
        lost samples of its own units.
    """

    def __init__(
        self,
        units: Iterable[str] = (),
        rules: ServiceRules | None = None,
        look: HealthProbe | None = None,
        *,
        leads: bool = True,
    ) -> None:
        self._look, names = look, list(units) if look else []
        subjects = {loss_key(unit): (unit, SERVICE_KINDS[SAMPLES_LOST]) for unit in names}
        # `ReportedAlarms` has the alarms about refused messages and units without analysis
        self._judged = [
            kind
            for kind in SERVICE_KINDS.values()
            if look and leads and kind.subject != UNIT and kind.name != MESSAGES_REFUSED
        ]
        subjects = {kind.name: (kind.subject, kind) for kind in self._judged} | subjects
        rules = rules or service_rules_of(AlarmSettings())
        self._watches = {
            key: watch(AlarmIdentity(PLANT, subject, kind.name), rules[kind.rule], subject)
            for key, (subject, kind) in subjects.items()
        }
        super().__init__(self._watches.values())
        self._losses = {unit: SampleLoss() for unit in names}
        self._inherited: set[str] = set()
        self._counted: dict[str, int] = {}

    def restore(
        self, stored: Iterable[Alarm], host_ns: int, memory: AlarmMemory | None = None
    ) -> list[AlarmNews]:
        """Restore stored alarms at the host time ``host_ns``, ns since 1970 UTC.

        Earlier losses are unknown, so an active alarm about lost samples stays active until this
        process has observed ten minutes.
        """
        news = super().restore(stored, host_ns, memory)
        self._inherited = {
            unit
            for unit in self._losses
            if self.alarm(self._watches[loss_key(unit)].id).level is not None
        }
        return news

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Update the alarms from the health of the service; return the changed alarms.

        `host_ns` is the host time, ns since 1970 UTC.
        """
        if self._look is not None:
            health = self._look()
            for kind in self._judged:
                self.update(self._watches[kind.name], self._judgement(kind.name, health), host_ns)
            self._judge_losses(health, host_ns)
        return super().tick(host_ns)

    def _judgement(self, name: str, health: ServiceHealth) -> Judgement:
        match name:
            case "results_not_stored":
                found = self._compared(name, health.store_behind_s)
                reason = health.store_error or "the store does not respond"
                return found if found.level is None else replace(found, reason=reason)
            case "results_lost":
                reason = health.unstored_reason or "given_up"
                return self._increase(name, health.n_unstored, AlarmLevel.DANGER, reason)
            case "recordings_damaged":
                n_damaged = health.n_recordings_damaged
                return self._increase(name, n_damaged, AlarmLevel.ALERT, "damaged_or_missing")
            case "disk_nearly_full":
                return health.disk(self._held(name))
        reading = health.readings.get(SERVICE_KINDS[name].reading or "")
        if reading is None:
            return WITHIN
        if isinstance(reading, str):
            level = AlarmLevel.DANGER if name in DANGER_KINDS else AlarmLevel.ALERT
            return Judgement(level, reason=reading)
        return self._compared(name, reading)

    def _increase(self, name: str, n_found: int, level: AlarmLevel, reason: str) -> Judgement:
        """Return the condition of an alarm on a count: active if the count has increased."""
        n_more, self._counted[name] = n_found - self._counted.get(name, 0), n_found
        return Judgement(level, value=float(n_found), reason=reason) if n_more > 0 else WITHIN

    def _judge_losses(self, health: ServiceHealth, now_ns: int) -> None:
        for unit, account in health.accounts.items():
            loss, key = self._losses[unit], loss_key(unit)
            condition = self._compared(key, loss.share(account, now_ns))
            if condition.level is not None or loss.is_complete(now_ns):
                self._inherited.discard(unit)
            if unit not in self._inherited:
                self.update(self._watches[key], condition, now_ns)

    def _held(self, key: str) -> AlarmLevel | None:
        return self.alarm(self._watches[key].id).condition.level

    def _compared(self, key: str, value: float) -> Judgement:
        return self._watches[key].judge(Reading(value), NOWHERE_KNOWN, self._held(key))


class ReportedAlarms(AlarmBoard):
    """Board of alarms with conditions that other components report, applied at the next update."""

    def __init__(self, watches: Iterable[Watch]) -> None:
        self._watches = {watch.id: watch for watch in watches}
        super().__init__(self._watches.values())
        self._found: dict[str, Judgement] = {}

    def report(self, id_: str, condition: Judgement) -> None:
        """Set the condition of the alarm with the id `id_` until the next report."""
        self._found[id_] = condition

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Update the alarms from the reported conditions at the host time ``host_ns``, ns."""
        for id_, condition in self._found.items():
            self.update(self._watches[id_], condition, host_ns)
        return super().tick(host_ns)


def identity_of(unit: str) -> AlarmIdentity:
    """Return the identity of the alarm about a unit that no process analyses."""
    return AlarmIdentity(PLANT, unit, ANALYSIS_GONE)


REFUSED_FOR_S = 600.0
"""Duration of the alarm after the last refused message, s."""

MAX_REASON = 200
"""Maximum number of characters of a reason, which may contain text of a refused message."""


class RefusedMessages(ReportedAlarms):
    """Alarms about refused stream messages, one for each unit, from reports for one update each."""

    def __init__(self, units: Iterable[str]) -> None:
        rule = rule_of(0.0, REFUSED_FOR_S)
        super().__init__(Watch(self._identity(unit), rule, STREAM) for unit in units)
        self._found = dict.fromkeys(self._watches, WITHIN)

    def refuse(self, unit: str, reason: str) -> None:
        """Raise the alarm about a refused message of a unit, with the reason."""
        words = "".join(c if c.isprintable() else "?" for c in reason[:MAX_REASON])
        self.report(self._identity(unit).id, Judgement(AlarmLevel.ALERT, reason=words))

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Update the alarms at the host time ``host_ns``, ns; each report counts once."""
        news = super().tick(host_ns)
        self._found = dict.fromkeys(self._watches, WITHIN)
        return news

    def _identity(self, unit: str) -> AlarmIdentity:
        return AlarmIdentity(unit, STREAM, MESSAGES_REFUSED)
