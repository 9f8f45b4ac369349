"""Periods of learning and comparing, and alarms out of decisions."""

import numpy as np
import pytest

from core.change.backtest import DecisionHistory
from core.limits import AlarmLevel
from core.units import DAY_NS
from service.cli.offline.backtest import event_of, time_ns_of
from service.cli.offline.backtest_bearing import Learning, MachineEvent, Period, periods_of
from service.cli.offline.backtest_report import alarm_stretches, change_report

DAYS = np.arange(100) * DAY_NS


def event(day: float, text: str = "overhaul") -> MachineEvent:
    return MachineEvent("U1", None, round(day * DAY_NS), text)


def test_each_event_begins_to_learn_anew_and_learning_ends_where_told() -> None:
    assert periods_of(DAYS, [], Learning(30)) == [Period(1, 0, 30, 100)]
    events = [event(70.5, "second"), event(50, "first")]
    assert periods_of(DAYS, events, Learning(20)) == [
        Period(1, 0, 20, 50),
        Period(2, 50, 70, 71, "first"),
        Period(3, 71, 91, 100, "second"),
    ]
    assert periods_of(DAYS + DAY_NS, [event(0), event(200)], Learning(30)) == [
        Period(1, 0, 30, 100, "overhaul")
    ]
    learning = Learning(20, until_ns=10 * DAY_NS)
    learned = [period.learned for period in periods_of(DAYS, [event(50)], learning)]
    assert learned == [10, 70]
    assert periods_of(DAYS, [event(10)], Learning(20))[0] == Period(1, 0, 10, 10)


def test_times_need_an_offset_and_an_event_is_a_place_a_time_and_words() -> None:
    assert time_ns_of("2025-01-01T02:00:00.000001+02:00") == 1_735_689_600_000_001_000
    with pytest.raises(ValueError, match="requires an offset from UTC"):
        time_ns_of("2025-01-01T02:00:00")
    with pytest.raises(ValueError, match="is not a time such as"):
        time_ns_of("yesterday")
    time_ns = 1_735_689_600 * 10**9
    of_unit = event_of("U1 2025-01-01T00:00:00Z new pads, LJB")
    assert of_unit == MachineEvent("U1", None, time_ns, "new pads, LJB")
    of_bearing = event_of("U1/LJB 2025-01-01T00:00:00Z")
    assert of_bearing == MachineEvent("U1", "LJB", time_ns, "machine event")
    assert of_bearing.is_about("U1", "LJB")
    assert not of_bearing.is_about("U1", "UJB")


@pytest.mark.parametrize("text", ["", "U1", "U1/ 2025-01-01T00:00:00Z", "U/1/2 x", "Ü 2025-01-01Z"])
def test_what_is_no_event_is_refused_with_an_example(text: str) -> None:
    with pytest.raises(
        ValueError, match="is not an event such as 'U1 2026-03-01T08:00:00Z overhaul'"
    ):
        event_of(text)


def decided(level: list[int], change: list[float]) -> DecisionHistory:
    n = len(level)
    return DecisionHistory(
        verdict=np.array(level, np.int8),
        level=np.array(level, np.int8),
        change=np.array(change),
        significance=np.full(n, 10.0),
        time_scale_h=np.full(n, 4.0),
    )


def test_an_alarm_that_rises_is_one_and_those_that_return_are_counted_each() -> None:
    decisions = decided([0, 1, 2, 1, 0], [0.0, -0.05, -0.2, -0.1, 0.0])
    (found,) = alarm_stretches(decisions)
    assert (found.begin, found.danger, found.end, found.level) == (1, 2, 4, AlarmLevel.DANGER)
    assert found.largest == 2
    largest = change_report(decisions, found.largest)
    assert largest.percent == pytest.approx(100.0 * (np.exp(-0.2) - 1.0))
    assert largest.u_percent == pytest.approx(100.0 * np.exp(-0.2) * 0.02)
    found = list(alarm_stretches(decided([1, 0, 1, 1], [0.1, 0.0, 0.2, 0.3])))
    assert [(alarm.begin, alarm.end, alarm.danger) for alarm in found] == [
        (0, 1, None),
        (2, None, None),
    ]
    assert list(alarm_stretches(decided([0, 0, 0], [0.0, 0.1, 0.2]))) == []
    assert list(alarm_stretches(decided([], []))) == []
