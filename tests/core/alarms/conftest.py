"""An alarm with its rule, to be led through its life."""

from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmKind, AlarmRule, Condition
from core.alarms.event import AlarmEvent
from core.alarms.life_cycle import advance
from core.alarms.operation import Action, operate


@dataclass
class Life:
    """One alarm and all its events."""

    rule: AlarmRule
    alarm: Alarm = field(
        default_factory=lambda: Alarm(AlarmIdentity("U1", "UJB", AlarmKind.SHAFT_X))
    )
    events: list[AlarmEvent] = field(default_factory=list)

    def find(self, condition: Condition, now_ns: int) -> list[str]:
        self.alarm, events = advance(self.alarm, condition, now_ns, self.rule)
        self.events += events
        return [event.change.value for event in events]

    def ask(self, action: Action, now_ns: int = 0) -> list[str]:
        self.alarm, events = operate(self.alarm, action, now_ns)
        self.events += events
        return [event.change.value for event in events]


@pytest.fixture
def life() -> Callable[..., Life]:
    """Builds an alarm by its delays and its latch."""
    return lambda on=0, off=0, latching=False: Life(AlarmRule(on, off, latching))
