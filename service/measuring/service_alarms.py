"""Alarms about the service itself."""

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import structlog

from acquisition.clock import Clock
from core.alarms.alarm import PLANT, Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.board import AlarmBoard
from core.alarms.kinds import LimitWatch, Watch, watch
from core.alarms.operation import Action
from core.alarms.rules import LimitRule, rule_of
from core.condition.cells import NOWHERE_KNOWN
from core.limits import WITHIN, AlarmLevel, Judgement, Limits
from core.quality import Reading
from core.samples.gaps import SampleAccount
from core.units import NS_PER_S
from service.settings.alarm_kinds import (
    ANALYSIS_GONE,
    MESSAGES_REFUSED,
    SAMPLES_LOST,
    SERVICE_KINDS,
    STREAM,
    UNIT,
)
from service.settings.alarms import AlarmSettings

DiskJudge = Callable[[AlarmLevel | None], Judgement]
"""What is to be said of the fullest disk, by the level that it had before."""


def enough_room(held: AlarmLevel | None) -> Judgement:
    """Say so where nobody looks at the disks."""
    del held
    return WITHIN


@dataclass(frozen=True)
class ServiceHealth:
    """How the service does at one moment.

    Parameters
    ----------
    store_error
        Why the store refused what was written last; None if it did not.
    store_behind_s
        For how long something has been waiting for the store without anything being written.
    n_unstored
        Findings since the start that the store did not take: given up, or refused and parked.
    unstored_reason
        Why the newest of them is not stored.
    waiting_share
        How far the queue from acquisition to analysis is filled, 0 to 1.
    analysis_delay_s
        For how long the oldest block in it has waited, or how far behind its device the block from
        a stream was that was taken in last.
    captures_error
        Why samples around alarms are not kept; None if they are.
    recording_error
        Why not all samples are recorded that should be, or recordings are not looked after, so that
        there may soon be no room for more; None if all is well.
    n_recordings_damaged
        Recordings that were found damaged or missing since the start.
    refused
        Which questions are refused because the service is behind; None if none are.
    stored_trouble
        In what stored data are not what was stored; None as far as nothing is known to be wrong.
    stream_trouble
        Why blocks are not read from the stream just now; None if they are, or need not be.
    accounts
        Where samples went, by unit of which some have come since the start.
    disk
        Judges how full the disks are.
    """

    store_error: str | None = None
    store_behind_s: float = 0.0
    n_unstored: int = 0
    unstored_reason: str | None = None
    waiting_share: float = 0.0
    analysis_delay_s: float = 0.0
    captures_error: str | None = None
    recording_error: str | None = None
    n_recordings_damaged: int = 0
    refused: str | None = None
    stored_trouble: str | None = None
    stream_trouble: str | None = None
    accounts: Mapping[str, SampleAccount] = field(default_factory=dict)
    disk: DiskJudge = enough_room


@dataclass(frozen=True)
class StreamStatus:
    """How blocks come over the stream, where they come that way.

    Parameters
    ----------
    trouble
        Why none come; None if they do.
    behind_s
        How far behind their devices those are that are taken in now.
    """

    trouble: Callable[[], str | None]
    behind_s: Callable[[], float]


HealthProbe = Callable[[], ServiceHealth]


log = structlog.get_logger()

STEP_S = 0.5
"""A clock that is kept right is slewed; one that moves so much at once has been set."""


class HostTime:
    """The host's wall clock, held against its steady one."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._seen: tuple[int, float] | None = None

    def look(self) -> tuple[int, bool]:
        """UTC nanoseconds, and whether the clock has been set since the look before.

        Time that seems to have passed by that must count for no delay.
        """
        now_ns, steady_s = self._clock.now_ns(), self._clock.monotonic_s()
        before, self._seen = self._seen, (now_ns, steady_s)
        if before is None:
            return now_ns, False
        step_s = (now_ns - before[0]) / NS_PER_S - (steady_s - before[1])
        if abs(step_s) <= STEP_S:
            return now_ns, False
        log.warning("the clock of this host was set", by_s=round(step_s, 3))
        return now_ns, True


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


def reporting_unit(identity: AlarmIdentity) -> str:
    """Unit whose process tells of an alarm: of lost samples, the one that analyses their unit."""
    return identity.subject if identity.kind == SAMPLES_LOST else identity.unit


LOSS_NS = 60 * LOSS_MINUTES * NS_PER_S
LEVELS = {"stored_data_damaged": AlarmLevel.DANGER, "stream_away": AlarmLevel.DANGER}
"""Levels of alarms about a trouble; of others, an alert."""

LOOK_EVERY_NS = 10 * NS_PER_S


class SampleLoss:
    """Which share of a unit's samples got lost or was refused in the last ten minutes.

    Where more is dropped as repeated than is new, that is lost, too: nothing repeats itself for
    minutes but a device that counts anew and has its clock put back, of which nobody would hear.
    """

    def __init__(self) -> None:
        self._seen: deque[tuple[int, int, int, int]] = deque()

    def share(self, account: SampleAccount, now_ns: int) -> float:
        """Take in the unit's account; ask once in a while."""
        offered = account.n_offered
        lost = account.n_gap + sum(account.rejected.values())
        if self._seen and offered < self._seen[-1][1]:
            self._seen.clear()  # the account begins anew
        if not self._seen or now_ns - self._seen[-1][0] >= LOOK_EVERY_NS:
            self._seen.append((now_ns, offered, lost, account.n_repeated))
        while len(self._seen) > 1 and now_ns - self._seen[0][0] > LOSS_NS:
            self._seen.popleft()
        _, offered_then, lost_then, repeated_then = self._seen[0]
        n_new, n_repeated = offered - offered_then, account.n_repeated - repeated_then
        n_dropped = n_repeated if n_repeated > n_new else 0
        return (lost - lost_then + n_dropped) / max(n_new + n_dropped, 1)

    def reaches_back(self, now_ns: int) -> bool:
        """Whether all of the last ten minutes was seen here, or nearly."""
        return bool(self._seen) and now_ns - self._seen[0][0] >= LOSS_NS - LOOK_EVERY_NS


class ServiceAlarms:
    """Owns the alarms that belong to no unit, and those of units that are there no more.

    Parameters
    ----------
    units
        Whose samples may get lost.
    rules
        Limits of the service.
    look
        How the service does now; None where nobody looks at that.
    leads
        Whether it is this process that raises what there is one alarm of for the whole plant; lost
        samples of its units are each process's own.
    """

    def __init__(
        self,
        units: Iterable[str] = (),
        rules: ServiceRules | None = None,
        look: HealthProbe | None = None,
        *,
        leads: bool = True,
    ) -> None:
        self._look, self._leads = look, leads
        names = list(units) if look else []
        watches = service_watches(names, rules or ServiceRules()) if look else {}
        own = {loss_key(unit) for unit in names}
        self._watches = {key: its for key, its in watches.items() if leads or key in own}
        self._board = AlarmBoard(self._watches.values())
        self._losses = {unit: SampleLoss() for unit in names}
        self._inherited: set[str] = set()
        self._n_unstored = 0
        self._n_damaged = 0

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All of them, whatever their state."""
        return self._board.alarms

    def alarm(self, id_: str) -> Alarm:
        """Look one up. Raises `KeyError` if there is no such alarm."""
        return self._board.alarm(id_)

    def operate(self, id_: str, action: Action, host_ns: int) -> list[AlarmNews]:
        """Do what somebody asks for.

        Raises
        ------
        KeyError
            If there is no such alarm.
        ActionRefusedError
            If it does not fit the alarm as it is now.
        """
        self._board.operate(id_, action, host_ns)
        return self._board.drain_news()

    def restore(self, alarms: Iterable[Alarm], host_ns: int) -> list[AlarmNews]:
        """Go on where the service stopped.

        Of what was lost before nothing is known here: lost samples that are an alarm stay one until
        this process has seen ten minutes without.
        """
        self._board.restore(alarms, host_ns)
        self._inherited = {
            unit
            for unit in self._losses
            if self._board.alarm(self._watches[loss_key(unit)].id).level is not None
        }
        return self._board.drain_news()

    def pause(self) -> None:
        """Let all delays stand still up to now."""
        self._board.pause()

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Look at the service once."""
        if self._look is not None:
            health = self._look()
            if self._leads:
                self._judge(health, host_ns)
            self._count_losses(health, host_ns)
        self._board.expire(host_ns)
        return self._board.drain_news()

    def _judge(self, health: ServiceHealth, now_ns: int) -> None:
        judges = {
            "results_not_stored": self._store,
            "results_lost": self._lost,
            "recordings_damaged": self._damaged,
            "disk_nearly_full": self._disk,
        }
        for name in filter(SERVICE_KINDS.__contains__, self._watches):
            judge = judges.get(name, partial(self._by_reading, name))
            self._update(name, judge(health), now_ns)

    def _by_reading(self, name: str, health: ServiceHealth) -> Judgement:
        """Judge the reading of a kind: a value, or the words of a trouble."""
        found: float | str | None = getattr(health, SERVICE_KINDS[name].reading or "")
        if found is None:
            return WITHIN
        if isinstance(found, str):
            return Judgement(LEVELS.get(name, AlarmLevel.ALERT), reason=found)
        return self._compared(name, found)

    def _count_losses(self, health: ServiceHealth, now_ns: int) -> None:
        for unit, account in health.accounts.items():
            seen = self._losses[unit]
            condition = self._compared(loss_key(unit), seen.share(account, now_ns))
            if condition.level is not None or seen.reaches_back(now_ns):
                self._inherited.discard(unit)
            if unit not in self._inherited:
                self._update(loss_key(unit), condition, now_ns)

    def _store(self, health: ServiceHealth) -> Judgement:
        found = self._compared("results_not_stored", health.store_behind_s)
        if found.level is None:
            return found
        return replace(found, reason=health.store_error or "the store does not answer")

    def _disk(self, health: ServiceHealth) -> Judgement:
        watch = self._watches["disk_nearly_full"]
        return health.disk(self._board.alarm(watch.id).condition.level)

    def _lost(self, health: ServiceHealth) -> Judgement:
        n_more = health.n_unstored - self._n_unstored
        self._n_unstored = health.n_unstored
        if n_more <= 0:
            return WITHIN
        reason = health.unstored_reason or "given_up"
        return Judgement(AlarmLevel.DANGER, value=float(health.n_unstored), reason=reason)

    def _damaged(self, health: ServiceHealth) -> Judgement:
        n_more = health.n_recordings_damaged - self._n_damaged
        self._n_damaged = health.n_recordings_damaged
        if n_more <= 0:
            return WITHIN
        n_all = float(health.n_recordings_damaged)
        return Judgement(AlarmLevel.ALERT, value=n_all, reason="damaged_or_missing")

    def _compared(self, key: str, value: float) -> Judgement:
        watch = self._watches[key]
        if not isinstance(watch, LimitWatch):
            raise TypeError(f"{key} has no limits")
        held = self._board.alarm(watch.id).condition.level
        return watch.limits.judge(Reading(value), NOWHERE_KNOWN, held)

    def _update(self, key: str, condition: Judgement, now_ns: int) -> None:
        self._board.update(self._watches[key], condition, now_ns)


class ReportedAlarms:
    """Owns alarms of some watches; what was told of each counts from the next tick on."""

    def __init__(self, watches: Iterable[Watch]) -> None:
        self._watches = {watch.id: watch for watch in watches}
        self._board = AlarmBoard(self._watches.values())
        self._found: dict[str, Judgement] = {}
        self._once: set[str] = set()

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All of them, whatever their state."""
        return self._board.alarms

    def __contains__(self, id_: str) -> bool:
        return id_ in self._board

    def alarm(self, id_: str) -> Alarm:
        """Look one up. Raises `KeyError` if there is no such alarm."""
        return self._board.alarm(id_)

    def tell(self, id_: str, condition: Judgement) -> None:
        """Note what is found; it lasts until something else is told."""
        self._found[id_] = condition
        self._once.discard(id_)

    def tell_once(self, id_: str, condition: Judgement) -> None:
        """Note what has happened, and is over already."""
        self.tell(id_, condition)
        self._once.add(id_)

    def operate(self, id_: str, action: Action, host_ns: int) -> list[AlarmNews]:
        """Do what somebody asks for; raises as `AlarmBoard.operate` does."""
        self._board.operate(id_, action, host_ns)
        return self._board.drain_news()

    def restore(self, alarms: Iterable[Alarm], host_ns: int) -> list[AlarmNews]:
        """Go on where somebody stopped."""
        self._board.restore(alarms, host_ns)
        return self._board.drain_news()

    def pause(self) -> None:
        """Let all delays stand still up to now."""
        self._board.pause()

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Judge what was told last."""
        for id_, condition in self._found.items():
            self._board.update(self._watches[id_], condition, host_ns)
        for id_ in self._once:
            self._found[id_] = WITHIN
        self._once.clear()
        self._board.expire(host_ns)
        return self._board.drain_news()


SHARED = "shared work"
"""In the place of a unit: reports and commands about these alarms. No unit can be called so."""


def is_shared(alarm: Alarm) -> bool:
    """Whether an alarm belongs to whoever does the shared work."""
    return alarm.identity.kind == ANALYSIS_GONE


def gone_alarms(units: Iterable[str]) -> ReportedAlarms:
    """The alarms of some units; nothing is known yet of any."""
    return ReportedAlarms(Watch(identity_of(unit), rule_of(0.0, 0.0), unit) for unit in units)


def judge(
    alarms: ReportedAlarms, silent: Sequence[str], heard: Sequence[str], after_s: float
) -> None:
    """Take in which units were heard of lately, and which were not."""
    reason = f"no sign of life for {after_s:g} s: is `padwatch analyse` running?"
    gone = Judgement(AlarmLevel.DANGER, reason=reason)
    for units, condition in ((silent, gone), (heard, WITHIN)):
        for unit in units:
            alarms.tell(identity_of(unit).id, condition)


def identity_of(unit: str) -> AlarmIdentity:
    """The alarm about a unit that nobody analyses."""
    return AlarmIdentity(PLANT, unit, ANALYSIS_GONE)


REFUSED_FOR_S = 600.0
"""How long an alarm stands after the last message that was refused."""

MAX_REASON = 200
"""Longest reason, letters: a message that is refused may hold anything."""


def stream_alarms(units: Iterable[str]) -> ReportedAlarms:
    """Alarms about messages of units that cannot be used."""
    alarms = ReportedAlarms(
        Watch(_refused(unit), rule_of(0.0, REFUSED_FOR_S), STREAM) for unit in units
    )
    for alarm in alarms.alarms:
        alarms.tell(alarm.identity.id, WITHIN)
    return alarms


def refuse(alarms: ReportedAlarms, unit: str, reason: str) -> None:
    """Note that a message of a unit was refused."""
    words = "".join(c if c.isprintable() else "?" for c in reason[:MAX_REASON])
    alarms.tell_once(_refused(unit).id, Judgement(AlarmLevel.ALERT, reason=words))


def _refused(unit: str) -> AlarmIdentity:
    return AlarmIdentity(unit, STREAM, MESSAGES_REFUSED)
