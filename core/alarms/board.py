"""`AlarmBoard`: alarms with their rules, and what is kept of a unit's alarms across a restart."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from core.alarms.alarm import Alarm, AlarmEvent, AlarmNews, AlarmRule
from core.alarms.kinds import LINK_LOST, Watch
from core.alarms.life_cycle import interrupted, restored, update
from core.alarms.operation import Action, expire, operate
from core.condition.cells import OperatingPoint
from core.limits import Judgement, unknown
from core.quality import Reason


@dataclass(frozen=True)
class AlarmMemory:
    """State of the alarms of a unit, with their delays, from which another process continues.

    Parameters
    ----------
    segment_faults
        Faults of channels that only segments show, by channel.
    points
        Newest operating condition of each bearing with its time, by bearing.
    stop
        Epoch and index up to which blocks were judged.
    """

    alarms: tuple[Alarm, ...]
    segment_faults: Mapping[str, Reason]
    points: Mapping[str, tuple[OperatingPoint, int]]
    stop: tuple[int, int] | None
    is_connected: bool
    link_reason: str | None


def is_same_occurrence(one: Alarm, other: Alarm) -> bool:
    """Whether an alarm has neither been raised nor returned between two moments."""
    return (one.level, one.occurrence) == (other.level, other.occurrence)


RESTARTED, NO_LONGER_WATCHED = "restarted", "no_longer_watched"


class AlarmBoard:
    """Owns some alarms, inactive at first, and their rules. News is in the order of events."""

    def __init__(self, watched: Iterable[Watch] = ()) -> None:
        watches = list(watched)
        self._rules = {watch.id: watch.rule for watch in watches}
        self._alarms = {watch.id: Alarm(watch.identity) for watch in watches}
        self._news: list[AlarmNews] = []

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All of them, whatever their state."""
        return list(self._alarms.values())

    def __contains__(self, id_: str) -> bool:
        return id_ in self._alarms

    def alarm(self, id_: str) -> Alarm:
        """Look one up. Raises `KeyError` if there is no such alarm."""
        return self._alarms[id_]

    def update(self, watch: Watch, condition: Judgement, now_ns: int) -> None:
        """Update an alarm; an inactive alarm that stays inactive is unchanged."""
        is_within = condition.level is None and condition.is_known
        if not (is_within and self._alarms[watch.id].is_settled_inactive):
            self.record(watch.id, condition, now_ns)

    def record(self, id_: str, condition: Judgement, now_ns: int) -> None:
        """Update an alarm, also with the value of a condition within limits."""
        self._note(id_, *update(self._alarms[id_], condition, now_ns, self._rules[id_]))

    def pause(self, spared: str | None = None) -> None:
        """Stop all delays up to now, except those of one kind of alarm.

        The clock was set and does not show how much time passed, or samples are missing.
        """
        self._alarms = {
            id_: alarm if alarm.identity.kind == spared else interrupted(alarm)
            for id_, alarm in self._alarms.items()
        }

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """End the shelving of alarms whose time is up."""
        for id_, alarm in self._alarms.items():
            if alarm.shelf is not None:
                self._note(id_, *expire(alarm, host_ns))
        return self.drain_news()

    def operate(self, id_: str, action: Action, host_ns: int) -> list[AlarmNews]:
        """Apply an action of a person.

        Raises
        ------
        KeyError
            If there is no such alarm.
        ActionRefusedError
            As `operate` does.
        """
        self._note(id_, *operate(self._alarms[id_], action, host_ns))
        return self.drain_news()

    def restore(
        self, stored: Iterable[Alarm], host_ns: int, memory: AlarmMemory | None = None
    ) -> list[AlarmNews]:
        """Continue after a restart: active alarms stay active, their conditions are unknown.

        An alarm without a rule returns to normal, and stays on the list until acknowledged.

        Parameters
        ----------
        stored
            Alarms after their newest events.
        memory
            State at the last block, if no sample is missing since: condition and delays of its
            alarms continue. Their stored form may be newer, by actions of people or, without
            samples, by the link. Alarms without a rule are left out.
        """
        kept = memory.alarms if memory else ()
        remembered = {a.identity.id: a for a in kept if a.identity.id in self._rules}
        newest = {alarm.identity.id: alarm for alarm in stored}
        for id_, alarm in newest.items():
            if id_ in remembered:
                continue
            if id_ in self._rules:
                self._alarms[id_] = restored(alarm)
                if alarm.identity.kind != LINK_LOST:
                    self.record(id_, unknown(RESTARTED, alarm.suppressed_by), host_ns)
            elif alarm.level is not None or not alarm.is_acknowledged:
                self._alarms[id_] = restored(replace(alarm, is_latched=False))
                self._rules[id_] = AlarmRule()
                self.record(id_, Judgement(reason=NO_LONGER_WATCHED), host_ns)
        for id_, alarm in remembered.items():
            self._alarms[id_] = _merged(alarm, newest.get(id_, alarm))
        return self.drain_news()

    def drain_news(self) -> list[AlarmNews]:
        """Return and forget the news since the last call."""
        news, self._news = self._news, []
        return news

    def _note(self, id_: str, alarm: Alarm, events: tuple[AlarmEvent, ...]) -> None:
        self._alarms[id_] = alarm
        if events:
            self._news.append(AlarmNews(alarm, events))


def _merged(kept: Alarm, stored: Alarm) -> Alarm:
    """A kept alarm with the changes of newer events."""
    if stored.n_events <= kept.n_events:
        return kept
    if stored.identity.kind == LINK_LOST and not is_same_occurrence(kept, stored):
        return restored(stored)
    return replace(stored, condition=kept.condition, timers=kept.timers)
