"""`ReplicaAlarms`: all alarms, as the processes that analyse have written them down."""

from collections.abc import Callable, Iterable, Sequence

from core.alarms.alarm import PLANT, Alarm
from core.alarms.statistics import ChatterRule
from service.live.alarm_board import AlarmCount, count_of
from service.live.unit_state import UnitState
from service.measuring.service_alarms import SHARED, is_shared, told_by


class ReplicaAlarms:
    """The newest of each alarm, from reports and from the table of alarms.

    Parameters
    ----------
    is_alive
        Whether a unit is analysed; of one that is not, nothing can be judged.
    """

    def __init__(
        self, units: Iterable[str], is_alive: Callable[[str], bool], chatter_rule: ChatterRule
    ) -> None:
        self._units = frozenset(units)
        self._is_alive, self.chatter_rule = is_alive, chatter_rule
        self._alarms: dict[str, Alarm] = {}
        self._judged: dict[str, frozenset[str]] = {}
        self._chattering: dict[str, frozenset[str]] = {}
        self._alive: dict[str, bool] = {}
        self._revision = 0

    @property
    def revision(self) -> int:
        """Another number as soon as anything is known otherwise of any alarm."""
        alive = {unit: self._is_alive(unit) for unit in self._judged}
        if alive != self._alive:  # somebody has fallen silent, of which no report tells
            self._alive = alive
            self._revision += 1
        return self._revision

    def take(self, unit: str, state: UnitState) -> None:
        """Take what was written down of a unit."""
        self._revision += 1
        self._judged[unit], self._chattering[unit] = state.judged, state.chattering
        # a process may remember alarms of units that others have taken over
        self.take_stored(alarm for alarm in state.alarms if self._owner(alarm) == unit)

    def take_stored(self, alarms: Iterable[Alarm]) -> None:
        """Take alarms, unless something later is known of them."""
        self._revision += 1
        for alarm in alarms:
            held = self._alarms.get(alarm.identity.id)
            if held is None or alarm.n_events >= held.n_events:
                self._alarms[alarm.identity.id] = alarm

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms, whatever their state."""
        return list(self._alarms.values())

    def alarm(self, id_: str) -> Alarm:
        """Look an alarm up. Raises `LookupError` if there is none."""
        return self._alarms[id_]

    def is_judged(self, alarm: Alarm) -> bool:
        """Whether what an alarm watches is known now; nothing is where nobody analyses."""
        unit = self._owner(alarm)
        return self._is_alive(unit) and alarm.identity.id in self._judged.get(unit, ())

    def is_chattering(self, alarm: Alarm) -> bool:
        """Whether an alarm has come and gone too often until a short while ago."""
        return alarm.identity.id in self._chattering.get(self._owner(alarm), ())

    def owner(self, id_: str) -> str:
        """Whose process does something to an alarm. Raises `LookupError` if there is none."""
        return self._owner(self.alarm(id_))

    def _owner(self, alarm: Alarm) -> str:
        """Its unit, or who else tells of it where it is of no unit that there is."""
        if is_shared(alarm):
            return SHARED
        unit = told_by(alarm.identity)
        return unit if unit in self._units else PLANT

    def count(self) -> AlarmCount:
        """How many alarms are on the list."""
        return count_of(self.alarms, self.is_judged)
