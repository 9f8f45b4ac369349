"""Alarms about units that no process analyses, and about refused stream messages."""

from collections.abc import Iterable

from core.alarms.alarm import PLANT, AlarmIdentity, AlarmNews
from core.alarms.board import AlarmBoard
from core.alarms.kinds import Watch
from core.alarms.rules import rule_of
from core.limits import WITHIN, AlarmLevel, Judgement
from service.settings.alarm_kinds import ANALYSIS_GONE, MESSAGES_REFUSED, STREAM


class ReportedAlarms(AlarmBoard):
    """Board of alarms with conditions that other components report, applied at the next update."""

    def __init__(self, watches: Iterable[Watch]) -> None:
        self._watches = {watch.id: watch for watch in watches}
        super().__init__(self._watches.values())
        self._found: dict[str, Judgement] = {}
        self._once: set[str] = set()

    def report(self, id_: str, condition: Judgement) -> None:
        """Set the condition of the alarm with the id `id_` until the next report."""
        self._found[id_] = condition
        self._once.discard(id_)

    def report_event(self, id_: str, condition: Judgement) -> None:
        """Set the condition of the alarm with the id `id_` for one update."""
        self.report(id_, condition)
        self._once.add(id_)

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """Update the alarms from the reported conditions at the host time ``host_ns``, ns."""
        for id_, condition in self._found.items():
            self.update(self._watches[id_], condition, host_ns)
        self._found |= dict.fromkeys(self._once, WITHIN)
        self._once.clear()
        return super().tick(host_ns)


def identity_of(unit: str) -> AlarmIdentity:
    """Return the identity of the alarm about a unit that no process analyses."""
    return AlarmIdentity(PLANT, unit, ANALYSIS_GONE)


REFUSED_FOR_S = 600.0
"""Duration of the alarm after the last refused message, s."""

MAX_REASON = 200
"""Maximum number of characters of a reason, which may contain text of a refused message."""


class RefusedMessages(ReportedAlarms):
    """Alarms about refused stream messages, one for each unit."""

    def __init__(self, units: Iterable[str]) -> None:
        rule = rule_of(0.0, REFUSED_FOR_S)
        super().__init__(Watch(self._identity(unit), rule, STREAM) for unit in units)
        self._found = dict.fromkeys(self._watches, WITHIN)

    def refuse(self, unit: str, reason: str) -> None:
        """Raise the alarm about a refused message of a unit, with the reason."""
        words = "".join(c if c.isprintable() else "?" for c in reason[:MAX_REASON])
        judgement = Judgement(AlarmLevel.ALERT, reason=words)
        self.report_event(self._identity(unit).id, judgement)

    def _identity(self, unit: str) -> AlarmIdentity:
        return AlarmIdentity(unit, STREAM, MESSAGES_REFUSED)
