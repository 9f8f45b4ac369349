"""`ServiceAlarms`: alarms about the store and the service itself, and about what is no more."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial

from core.alarms.alarm import Alarm, AlarmNews
from core.alarms.board import AlarmBoard
from core.alarms.kinds import LimitWatch
from core.alarms.operation import Action
from core.condition.cells import NOWHERE_KNOWN
from core.limits import WITHIN, AlarmLevel, Judgement
from core.quality import Reading
from core.samples.gaps import SampleAccount
from core.units import NS_PER_S
from service.measuring.alarms.health import LookAtHealth, ServiceHealth
from service.measuring.alarms.service_rules import (
    LOSS_MINUTES,
    ServiceRules,
    loss_key,
    service_watches,
)
from service.settings.alarm_kinds import SERVICE_KINDS

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
        look: LookAtHealth | None = None,
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
