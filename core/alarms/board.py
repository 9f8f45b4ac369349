"""All alarms of a unit, and what is kept of them across a restart."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from core.alarms.alarm import Alarm, AlarmKind, AlarmRule
from core.alarms.event import AlarmEvent, AlarmNews
from core.alarms.kinds import Watch
from core.alarms.life_cycle import advance, interrupted, restored
from core.alarms.operation import Action, expire, operate
from core.condition.cells import OperatingPoint
from core.limits import Condition, unknown
from core.quality import Reason


@dataclass(frozen=True)
class AlarmMemory:
    """The alarms of a unit at one moment, so that they go on elsewhere as if nothing were.

    Parameters
    ----------
    alarms
        With their delays.
    segment_faults
        What only segments show of channels, by channel.
    points
        Newest operating condition of each bearing, and when that was.
    stop
        Epoch and index up to which blocks were taken in.
    is_connected, link_reason
        What was said of the link last.
    """

    alarms: tuple[Alarm, ...]
    segment_faults: Mapping[str, Reason]
    points: Mapping[str, tuple[OperatingPoint, int]]
    stop: tuple[int, int] | None
    is_connected: bool
    link_reason: str | None

    def link_by(self, alarm: Alarm) -> tuple[bool, str | None]:
        """Whether samples arrive as far as is known, and why not.

        Parameters
        ----------
        alarm
            About the link, by its newest event. What came of it since all this was remembered
            counts more: a link that was lost then stays lost until samples come.
        """
        kept = next((a for a in self.alarms if a.identity == alarm.identity), Alarm(alarm.identity))
        if is_same_occurrence(kept, alarm):
            return self.is_connected, self.link_reason
        return (True, None) if alarm.level is None else (False, alarm.condition.reason)


def is_same_occurrence(one: Alarm, other: Alarm) -> bool:
    """Whether an alarm has neither been raised nor returned between two moments."""
    return (one.level, one.occurrence) == (other.level, other.occurrence)


RESTARTED, NO_LONGER_WATCHED = "restarted", "no_longer_watched"

JUDGED_WITHOUT_DATA = (AlarmKind.LINK_LOST,)
"""Kinds whose condition is known whether samples arrive or not."""


class AlarmBoard:
    """Owns some alarms. News come in the order in which things happened.

    Parameters
    ----------
    watched
        What may raise an alarm.
    """

    def __init__(self, watched: Iterable[Watch]) -> None:
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

    def find(self, watch: Watch, condition: Condition, now_ns: int) -> None:
        """Take in what is found; of what rests and goes on resting, that is nothing."""
        alarm = self._alarms[watch.id]
        if condition.level is None and condition.is_known and alarm.is_resting:
            return
        self.advance(watch.id, condition, now_ns)

    def advance(self, id_: str, condition: Condition, now_ns: int) -> None:
        """Take in what is found, and remember it even if nothing comes of it."""
        self._note(id_, *advance(self._alarms[id_], condition, now_ns, self._rules[id_]))

    def interrupt(self) -> None:
        """Let delays stand still where samples are missing."""
        self._alarms = {
            id_: alarm if alarm.identity.kind in JUDGED_WITHOUT_DATA else interrupted(alarm)
            for id_, alarm in self._alarms.items()
        }

    def pause(self) -> None:
        """Let all delays stand still up to now: time has not passed as the clock says."""
        self._alarms = {id_: interrupted(alarm) for id_, alarm in self._alarms.items()}

    def expire(self, host_ns: int) -> None:
        """Bring back what was shelved until now."""
        for id_, alarm in self._alarms.items():
            if alarm.shelf is not None:
                self._note(id_, *expire(alarm, host_ns))

    def operate(self, id_: str, action: Action, host_ns: int) -> None:
        """Do what somebody asks for.

        Raises
        ------
        KeyError
            If there is no such alarm.
        ActionRefusedError
            If it does not fit the alarm as it is now.
        """
        self._note(id_, *operate(self._alarms[id_], action, host_ns))

    def restore(self, alarms: Iterable[Alarm], host_ns: int) -> None:
        """Go on where the service stopped: what was active is, and its condition is unknown.

        An alarm that nothing watches any more returns; it stays on the list until acknowledged.
        """
        for stored in alarms:
            id_ = stored.identity.id
            if id_ in self._rules:
                self._alarms[id_] = restored(stored)
                if stored.identity.kind not in JUDGED_WITHOUT_DATA:
                    self.advance(id_, unknown(RESTARTED, stored.suppressed_by), host_ns)
            elif stored.level is not None or not stored.is_acknowledged:
                self._alarms[id_] = restored(replace(stored, is_latched=False))
                self._rules[id_] = AlarmRule()
                self.advance(id_, Condition(reason=NO_LONGER_WATCHED), host_ns)

    def resume(self, kept: Iterable[Alarm], stored: Iterable[Alarm]) -> None:
        """Go on as if nothing had been: from alarms as they were kept, with their delays.

        Parameters
        ----------
        kept
            All of them watched.
        stored
            As they were after their newest events, which may be newer: what people did since, and
            what became of a link while no block came with which more could be kept.
        """
        newest = {alarm.identity.id: alarm for alarm in stored}
        for alarm in kept:
            id_ = alarm.identity.id
            self._alarms[id_] = _gone_on(alarm, newest.get(id_, alarm))

    def told(self) -> list[AlarmNews]:
        """Hand over the news since the last call."""
        news, self._news = self._news, []
        return news

    def _note(self, id_: str, alarm: Alarm, events: tuple[AlarmEvent, ...]) -> None:
        self._alarms[id_] = alarm
        if events:
            self._news.append(AlarmNews(alarm, events))


def _gone_on(kept: Alarm, stored: Alarm) -> Alarm:
    """An alarm as it was kept, with what its newest events have made of it since."""
    if stored.n_events <= kept.n_events:
        return kept
    if stored.identity.kind in JUDGED_WITHOUT_DATA and not is_same_occurrence(kept, stored):
        return restored(stored)
    return replace(stored, condition=kept.condition, timers=kept.timers)
