"""Alarms out of decisions: where they begin, rise, and end."""

import numpy as np

from core.alarms.alarm import AlarmLevel
from core.decision.back_test import DecisionHistory
from service.back_test.alarm_stretches import alarm_stretches


def decided(level: list[int], change: list[float]) -> DecisionHistory:
    n = len(level)
    return DecisionHistory(
        verdict=np.array(level, np.int8),
        level=np.array(level, np.int8),
        change=np.array(change),
        significance=np.full(n, 10.0),
        time_scale_h=np.full(n, 4.0),
    )


def test_a_quiet_film_has_no_alarm() -> None:
    assert list(alarm_stretches(decided([0, 0, 0], [0.0, 0.1, 0.2]))) == []
    assert list(alarm_stretches(decided([], []))) == []


def test_an_alarm_that_rises_is_one_alarm() -> None:
    (found,) = alarm_stretches(decided([0, 1, 2, 1, 0], [0.0, -0.05, -0.2, -0.1, 0.0]))
    assert (found.begin, found.danger, found.end, found.level) == (1, 2, 4, AlarmLevel.DANGER)
    assert (found.raised.change, found.largest.change, found.largest.row) == (-0.05, -0.2, 2)
    assert found.largest.std == 0.02


def test_alarms_that_return_are_counted_each_and_the_last_may_last() -> None:
    found = list(alarm_stretches(decided([1, 0, 1, 1], [0.1, 0.0, 0.2, 0.3])))
    assert [(alarm.begin, alarm.end, alarm.danger) for alarm in found] == [
        (0, 1, None),
        (2, None, None),
    ]
