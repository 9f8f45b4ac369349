"""List of all alarms in the serving process, and numbers of alarms by state."""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

from core.alarms.alarm import PLANT, Alarm, AlarmIdentity, AlarmState
from core.alarms.statistics import HIDDEN, ChatterRule
from core.limits import AlarmLevel
from service.live.snapshot import UnitSnapshot
from service.runtime.models import ValueModel
from service.settings.alarm_kinds import ANALYSIS_GONE, SAMPLES_LOST


@dataclass(frozen=True)
class AlarmCount:
    """Numbers of alarms by state; an alarm may be counted in several states."""

    __pydantic_config__ = ValueModel.model_config  # the API shows the counts

    n_active: int
    """Number of active alarms that are not hidden (shelved, suppressed or out of service)."""

    n_danger: int
    """Number of these active alarms whose level is danger."""

    n_unacknowledged: int
    """Number of alarms that are not hidden and whose newest occurrence is unacknowledged."""

    n_hidden: int
    """Number of alarms that are shelved, suppressed or out of service."""

    n_unjudged: int
    """Number of alarms that are neither active nor hidden and whose condition is unknown."""


class UnknownAlarmError(LookupError):
    """Error raised if an alarm does not exist."""


SHARED = "shared work"
"""Name used instead of a unit in reports and commands about shared alarms; not a valid unit id."""


def is_shared(alarm: Alarm) -> bool:
    """Return whether an alarm belongs to the process that runs the plant-wide tasks."""
    return alarm.identity.kind == ANALYSIS_GONE


def reporting_unit(identity: AlarmIdentity) -> str:
    """Return the unit whose process reports an alarm; for lost samples, the alarm's subject."""
    return identity.subject if identity.kind == SAMPLES_LOST else identity.unit


def owner_of(alarm: Alarm, units: Collection[str]) -> str:
    """Return the one of `units` whose process updates an alarm; `SHARED` or `PLANT` without one."""
    if is_shared(alarm):
        return SHARED
    unit = reporting_unit(alarm.identity)
    return unit if unit in units else PLANT


ShownAlarm = tuple[Alarm, bool, bool]
"""Alarm, whether its condition is known, and whether it is chattering."""


class LiveAlarms:
    """List of all alarms, from reports and from the database.

    `is_alive` returns whether reports on a unit arrive; while none arrive, the conditions of the
    alarms of the unit are unknown. `chatter_rule` defines chattering alarms.
    """

    def __init__(
        self, units: Iterable[str], is_alive: Callable[[str], bool], chatter_rule: ChatterRule
    ) -> None:
        self._units = frozenset(units)
        self._is_alive, self.chatter_rule = is_alive, chatter_rule
        self._alarms: dict[str, dict[str, Alarm]] = {}
        self._judged: dict[str, frozenset[str]] = {}
        self._chattering: dict[str, frozenset[str]] = {}
        self._alive: dict[str, bool] = {}
        self._shown: dict[str, Sequence[ShownAlarm]] = {}
        self._revision = 0

    @property
    def revision(self) -> int:
        """Counter that increases with every change of `shown`."""
        for unit, was_alive in self._alive.items():
            if self._is_alive(unit) != was_alive:  # a unit falls silent without a report
                self._show(unit)
        return self._revision

    @property
    def shown(self) -> Sequence[Alarm]:
        """Alarms that are not normal, and normal alarms whose condition is unknown."""
        return [alarm for shown in self._shown.values() for alarm, *_ in shown]

    def take(self, unit: str, state: UnitSnapshot) -> None:
        """Update the alarms of a unit from its newest reported state."""
        self._judged[unit], self._chattering[unit] = state.judged, state.chattering
        # a process may still have alarms of units for which another process is now responsible
        self._keep(alarm for alarm in state.alarms if owner_of(alarm, self._units) == unit)
        self._show(unit)

    def take_stored(self, alarms: Iterable[Alarm]) -> None:
        """Update the alarms from the database, except those that are newer in memory."""
        for unit in self._keep(alarms):
            self._show(unit)

    def _keep(self, alarms: Iterable[Alarm]) -> set[str]:
        """Keep alarms that are at least as new as those in memory; return their units."""
        units = set()
        for alarm in alarms:
            units.add(unit := owner_of(alarm, self._units))
            of_unit = self._alarms.setdefault(unit, {})
            held = of_unit.get(alarm.identity.id)
            if held is None or alarm.n_events >= held.n_events:
                of_unit[alarm.identity.id] = alarm
        return units

    def _show(self, unit: str) -> None:
        self._alive[unit] = self._is_alive(unit)
        alarms = list(self._alarms.get(unit, {}).values())
        known = ((a, self.is_judged(a), self.is_chattering(a)) for a in alarms)
        shown = [each for each in known if each[0].state is not AlarmState.NORMAL or not each[1]]
        self._revision += shown != self._shown.get(unit, [])
        self._shown[unit] = shown

    @property
    def alarms(self) -> Sequence[Alarm]:
        """All alarms of the plant, active or not."""
        return [alarm for alarms in list(self._alarms.values()) for alarm in list(alarms.values())]

    def alarm(self, id_: str) -> Alarm:
        """Return the alarm with an id; raise `UnknownAlarmError` if it does not exist."""
        for alarms in self._alarms.values():
            if id_ in alarms:
                return alarms[id_]
        raise UnknownAlarmError(f"unknown alarm {id_!r}")

    def is_judged(self, alarm: Alarm) -> bool:
        """Return whether the condition of an alarm is known now according to the latest report."""
        unit = owner_of(alarm, self._units)
        return self._is_alive(unit) and alarm.identity.id in self._judged.get(unit, ())

    def is_chattering(self, alarm: Alarm) -> bool:
        """Return whether an alarm is chattering (changes too often) by the latest report."""
        return alarm.identity.id in self._chattering.get(owner_of(alarm, self._units), ())

    def owner(self, id_: str) -> str:
        """Return the unit whose process updates an alarm; raise `UnknownAlarmError` without it."""
        return owner_of(self.alarm(id_), self._units)

    def count(self) -> AlarmCount:
        """Return the numbers of active, unacknowledged, hidden and unjudged alarms."""
        listed = self.shown
        visible = [alarm for alarm in listed if alarm.state not in HIDDEN]
        return AlarmCount(
            n_active=sum(alarm.level is not None for alarm in visible),
            n_danger=sum(alarm.level is AlarmLevel.DANGER for alarm in visible),
            n_unacknowledged=sum(not alarm.is_acknowledged for alarm in visible),
            n_hidden=len(listed) - len(visible),
            n_unjudged=sum(a.level is None and not self.is_judged(a) for a in visible),
        )
