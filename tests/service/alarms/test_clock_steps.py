"""A host's clock that somebody sets makes no delay pass, and holds none up."""

from typing import Any

import pytest

from core.alarms.rules import UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.machine import Bearing, Channel, Measurand, Unit
from service.alarms.engine import AlarmEngine

DELAY_S = 10.0
NAMES = ("sx", "sy", "bx", "by")
UNIT = Unit(
    "U1",
    60.0,
    100.0,
    tuple(Channel(name, Measurand.DISPLACEMENT_UM) for name in NAMES),
    (Bearing("UJB", 1.18e9, *NAMES, 200.0, (2000.0, 2000.0)),),
)
LINK = "U1:link:link_lost"


class Host:
    """A steady clock, and a wall clock that may be set."""

    def __init__(self) -> None:
        self.s, self.set_by_s = 1000.0, 0.0

    def now_ns(self) -> int:
        return round((1_767_225_600.0 + self.s + self.set_by_s) * 1e9)

    def monotonic_s(self) -> float:
        return self.s

    async def sleep(self, duration_s: float) -> None:
        raise AssertionError(f"nobody waits for {duration_s} s here")


@pytest.fixture
def host() -> Host:
    return Host()


@pytest.fixture
def engine(host: Host) -> AlarmEngine:
    rules = UnitRules(channel=rule_of(2.0, 4.0), link=rule_of(DELAY_S, 0.0))
    return AlarmEngine({"U1": UnitAlarms(UNIT, rules)}, lambda _: None, host)


@pytest.mark.parametrize("set_by_s", [0.0, 7200.0, -3600.0, 0.3])
def test_a_lost_link_is_told_after_its_delay_whatever_the_clock_is_set_to(
    engine: AlarmEngine, host: Host, set_by_s: float
) -> None:
    engine.link("U1", True)
    engine.link("U1", False, "not connected")
    told: list[Any] = []
    for second in range(30):
        if second == 4:
            host.set_by_s = set_by_s
        engine.tick()
        told.append(engine.alarm(LINK).level)
        host.s += 1.0

    since = told.index(next(level for level in told if level is not None))
    assert since in (round(DELAY_S), round(DELAY_S) + 1)  # the second of the step may not count
