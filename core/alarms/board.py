"""`AlarmBoard`: set of alarms with their rules. `AlarmMemory`: alarm state saved for a restart."""

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
    """State of a unit's alarms and delay timers, from which another process continues.

    Parameters
    ----------
    segment_faults
        Channel faults that were detected from segments, by channel id.
    points
        Newest operating point of each bearing and its sample time in ns, by bearing id.
    stop
        Epoch of the sample count, and index of the first sample after the newest judged block; None
        before the first block.
    is_connected
        Whether the link to the device was up.
    link_reason
        Reason why the link was down; None if it was up, or if the reason is unknown.
    """

    alarms: tuple[Alarm, ...]
    segment_faults: Mapping[str, Reason]
    points: Mapping[str, tuple[OperatingPoint, int]]
    stop: tuple[int, int] | None
    is_connected: bool
    link_reason: str | None


def is_same_occurrence(one: Alarm, other: Alarm) -> bool:
    """Whether two states of an alarm have the same level and occurrence number."""
    return (one.level, one.occurrence) == (other.level, other.occurrence)


RESTARTED, NO_LONGER_WATCHED = "restarted", "no_longer_watched"


class AlarmBoard:
    """Set of alarms, one for each definition in `watched`; all are inactive at first."""

    def __init__(self, watched: Iterable[Watch] = ()) -> None:
        watches = list(watched)
        self._rules = {watch.id: watch.rule for watch in watches}
        self._alarms = {watch.id: Alarm(watch.identity) for watch in watches}
        self._news: list[AlarmNews] = []

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms of the board, including inactive and hidden alarms."""
        return list(self._alarms.values())

    def __contains__(self, id_: str) -> bool:
        return id_ in self._alarms

    def alarm(self, id_: str) -> Alarm:
        """Return the alarm with an id. Raises `KeyError` if there is no such alarm."""
        return self._alarms[id_]

    def update(self, watch: Watch, condition: Judgement, now_ns: int) -> None:
        """Update an alarm from a judgement at `now_ns`, unless it is inactive and stays so."""
        is_within = condition.level is None and condition.is_known
        if not (is_within and self._alarms[watch.id].is_settled_inactive):
            self.record(watch.id, condition, now_ns)

    def record(self, id_: str, condition: Judgement, now_ns: int) -> None:
        """Update the alarm with an id from a judgement at the time `now_ns`.

        The resulting events are returned by `drain_news`. Raises `KeyError` for an unknown id.
        """
        self._note(id_, *update(self._alarms[id_], condition, now_ns, self._rules[id_]))

    def pause(self, spared: str | None = None) -> None:
        """Pause the delay timers of all alarms, except alarms of the kind `spared`.

        Call this if the elapsed time is unknown: samples are missing, or the clock was set.
        """
        self._alarms = {
            id_: alarm if alarm.identity.kind == spared else interrupted(alarm)
            for id_, alarm in self._alarms.items()
        }

    def tick(self, host_ns: int) -> list[AlarmNews]:
        """End all shelving that has expired at a host time; return the changed alarms."""
        for id_, alarm in self._alarms.items():
            if alarm.shelf is not None:
                self._note(id_, *expire(alarm, host_ns))
        return self.drain_news()

    def operate(self, id_: str, action: Action, host_ns: int) -> list[AlarmNews]:
        """Apply an action of a person at a host time; return the changed alarm with its events.

        Raises
        ------
        KeyError
            If there is no such alarm.
        ActionRefusedError
            If the action does not fit the state of the alarm.
        """
        self._note(id_, *operate(self._alarms[id_], action, host_ns))
        return self.drain_news()

    def restore(
        self, stored: Iterable[Alarm], host_ns: int, memory: AlarmMemory | None = None
    ) -> list[AlarmNews]:
        """Restore alarms after a restart; return the alarms that this changes, with the events.

        An active alarm stays active; its condition is unknown unless the memory includes it. An
        alarm without a rule returns to normal and stays on the list until acknowledged.

        Parameters
        ----------
        stored, host_ns
            Alarms as stored with their newest events, and host time of the restart, ns.
        memory
            State at the last block; None if samples were lost since then. A stored alarm may be
            newer because of an action or a link event. Alarms without a rule are ignored.
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
        """Return the alarms changed since the last call, with their events, and clear the list."""
        news, self._news = self._news, []
        return news

    def _note(self, id_: str, alarm: Alarm, events: tuple[AlarmEvent, ...]) -> None:
        self._alarms[id_] = alarm
        if events:
            self._news.append(AlarmNews(alarm, events))


def _merged(kept: Alarm, stored: Alarm) -> Alarm:
    """Return the alarm of the memory, updated from the stored alarm if this has more events."""
    if stored.n_events <= kept.n_events:
        return kept
    if stored.identity.kind == LINK_LOST and not is_same_occurrence(kept, stored):
        return restored(stored)
    return replace(stored, condition=kept.condition, timers=kept.timers)
