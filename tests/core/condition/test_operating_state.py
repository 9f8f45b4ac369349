from dataclasses import replace

import numpy as np
import pytest
from rigs.tiers import first_fast

from core.change.backtest import operation_history
from core.condition.cells import CellGrid, FilmConditions
from core.condition.operating_state import (
    NOT_AT_SPEED,
    UNKNOWN_OPERATION,
    OperatingLimits,
    OperatingState,
    Operation,
    step_operation,
)

LIMITS = OperatingLimits(rated_speed_rpm=92.3, rated_power_mw=330.0, warm_up_s=1200.0)
MINUTE_NS = 60_000_000_000


def run(
    speeds_rpm: list[float], powers_mw: list[float], step_ns: int = MINUTE_NS
) -> list[Operation]:
    operation, found = UNKNOWN_OPERATION, []
    for index, (speed_rpm, power_mw) in enumerate(zip(speeds_rpm, powers_mw, strict=True)):
        operation = step_operation(operation, index * step_ns, speed_rpm, power_mw, LIMITS)
        found.append(operation)
    return found


def test_a_start_and_a_stop_pass_through_every_state():
    found = run(
        [0.0, 40.0, 92.3, 92.3, 92.3, 92.3, 40.0, 0.0], [0.0, 0.0, 0.0, 150.0, 320.0, 0.0, 0.0, 0.0]
    )
    assert [operation.state.name for operation in found] == [
        *("STANDSTILL", "RUN_UP", "SPEED_NO_LOAD", "PART_LOAD", "FULL_LOAD"),
        *("SPEED_NO_LOAD", "RUN_DOWN", "STANDSTILL"),
    ]


def test_a_state_settles_after_its_time_and_stays_where_power_hovers_at_a_limit():
    powers_mw = [280.0 + swing for swing in (-20.0, 3.0, -3.0, 3.0, -3.0)]
    assert {o.state for o in run([92.3] * 5, powers_mw)} == {OperatingState.PART_LOAD}
    settled = [o.is_settled(LIMITS) for o in run([92.3] * 40, [200.0] * 40)]
    assert settled == [False] * 30 + [True] * 10


def test_a_warm_up_lasts_on_through_changes_of_load():
    limits = OperatingLimits(rated_speed_rpm=92.3, rated_power_mw=330.0)
    operation, settled = UNKNOWN_OPERATION, []
    for minute in range(0, 8 * 60, 10):
        speed_rpm = float("nan") if minute == 100 else 92.3
        power_mw = 200.0 if minute < 200 else 320.0
        operation = step_operation(operation, minute * MINUTE_NS, speed_rpm, power_mw, limits)
        settled.append(operation.is_settled(limits))
    assert settled == [False] * 36 + [True] * 12


def warm_after_h(run_h: float, is_warm_restart: bool) -> float | None:
    """Running hours after which readings of a start count; None if the run ends before."""
    limits = OperatingLimits(rated_speed_rpm=92.3, rated_power_mw=330.0)
    minutes = np.arange(0, int(run_h * 60), 10)
    one = np.ones(minutes.size)
    oil_c = 46.0 - (4.0 if is_warm_restart else 20.0) * np.exp(-minutes / 48.0)
    found = operation_history(minutes * MINUTE_NS, 92.3 * one, 320.0 * one, limits, oil_c)
    rows = np.flatnonzero(found.is_settled)
    return float(minutes[rows[0]] / 60.0) if rows.size else None


def test_a_bearing_is_warm_when_its_oil_has_settled_and_not_after_a_number_of_hours():
    """Oil of a time constant of 48 min, from cold and after a short stop."""
    assert warm_after_h(12.0, is_warm_restart=False) == pytest.approx(5.0, abs=0.4)
    assert warm_after_h(5.0, is_warm_restart=True) == pytest.approx(3.7, abs=0.4)
    assert warm_after_h(3.0, is_warm_restart=True) is None


def test_without_speed_or_power_or_after_a_gap_the_state_is_unknown_and_time_goes_on():
    before = step_operation(UNKNOWN_OPERATION, 0, 92.3, 200.0, LIMITS)
    after = step_operation(before, 120 * MINUTE_NS, 50.0, 0.0, LIMITS)
    assert after.state is OperatingState.UNKNOWN
    states = [o.state for o in run([float("nan"), 92.3], [200.0, float("nan")])]
    assert states == [OperatingState.UNKNOWN] * 2
    operation = step_operation(UNKNOWN_OPERATION, 5, 92.3, 200.0, LIMITS)
    with pytest.raises(ValueError, match="must be after the previous reading at 5 ns"):
        step_operation(operation, 5, 92.3, 200.0, LIMITS)


def wander(random: np.random.Generator, n: int, top: float) -> np.ndarray:
    """From nothing to a little above the top and back, with rests at both."""
    swing = np.cumsum(random.normal(0.0, 0.1, n))
    return top * np.clip(0.5 + 0.7 * np.sin(swing) + random.normal(0.0, 0.01, n), 0.0, 1.0)


@pytest.mark.parametrize("seed", first_fast(4, range(20)))
def test_a_history_has_the_states_that_its_readings_have_one_by_one(seed):
    random = np.random.default_rng(seed)
    n = 4000
    speed_rpm = wander(random, n, 95.0)
    power_mw = wander(random, n, 340.0)
    speed_rpm[random.random(n) < 0.03] = np.nan
    power_mw[random.random(n) < 0.03] = np.nan
    step_ns = np.where(random.random(n) < 0.05, 90 * MINUTE_NS, 7 * MINUTE_NS)
    time_ns = np.cumsum(step_ns).astype(np.int64)
    oil_c = 40.0 + np.cumsum(random.normal(0.0, 0.2, n))
    oil_c[random.random(n) < 0.03] = np.nan
    limits = replace(LIMITS, oil_settling_s=1800.0, settling_s=900.0, warm_up_s=4800.0)
    operation, oil, states, settled, warm = UNKNOWN_OPERATION, NOT_AT_SPEED, [], [], 0
    for now_ns, rpm, mw, now_c in zip(time_ns, speed_rpm, power_mw, oil_c, strict=True):
        operation = step_operation(operation, int(now_ns), rpm, mw, limits)
        oil = oil.step(operation, now_c, limits)
        states.append(int(operation.state))
        settled.append(operation.is_settled(limits, oil.has_settled))
        warm += settled[-1] and not operation.is_settled(limits)
    assert warm > 10  # before the longest time
    found = operation_history(time_ns, speed_rpm, power_mw, limits, oil_c)
    assert found.state.tolist() == states
    assert found.is_settled.tolist() == settled
    assert len(set(states)) >= len(OperatingState) - 1


def test_states_that_are_told_settle_as_those_that_are_followed():
    n = 300
    power_mw = np.where(np.arange(n) % 120 < 90, 200.0, 320.0)
    speed_rpm = np.where(np.arange(n) > 200, np.where(np.arange(n) > 210, 92.3, 0.0), 92.3)
    time_ns = 10 * MINUTE_NS * np.arange(n)
    limits = OperatingLimits(rated_speed_rpm=92.3, rated_power_mw=330.0)
    followed = operation_history(time_ns, speed_rpm, power_mw, limits)
    told = operation_history(time_ns, np.nan * speed_rpm, power_mw, limits, state=followed.state)
    assert told.is_settled.tolist() == followed.is_settled.tolist()
    assert 0 < np.sum(told.is_settled) < n
    assert set(followed.state.tolist()) > {OperatingState.PART_LOAD, OperatingState.STANDSTILL}


def one(grid: CellGrid, e: float, t: float, attitude_deg: float = 0.0) -> tuple[int, ...]:
    cells = grid.cells(FilmConditions.one(e, t, attitude_deg))
    return tuple(int(i) for i in cells[:, 0])


def test_a_reading_lies_in_the_cell_whose_middle_is_nearest_also_in_frost():
    grid = CellGrid(0.05, 2.5, attitude_width_deg=30.0)
    assert grid.centre(one(grid, 0.32, 41.0, 725.0)) == pytest.approx((0.325, 41.25, 15.0))
    assert one(grid, 0.0, -0.1, -10.0) == (0, -1, 11)
    nan, some = float("nan"), 0.3
    assert not CellGrid().is_known(FilmConditions.one(some, nan, some))[0]
    assert CellGrid().is_known(FilmConditions.one(some, some, nan))[0]
    assert not CellGrid(attitude_width_deg=30.0).is_known(FilmConditions.one(some, some, nan))[0]
