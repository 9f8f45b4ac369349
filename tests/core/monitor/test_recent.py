"""A step of vibration is known within seconds, however long the averages are."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from rigs.tiers import first_fast

from core.alarms.rules import LimitRule, UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.arrays import FloatArray
from core.limits import Limits
from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from core.spectra.overall import MAX_PARTS, PART_TURNS, parts_of

HOP, SEGMENT = 7168, 8192
DELAYS_S = (0.0, 1.0, 10.0, 15.0)
WITHIN_S = 30.0

Blocks = Callable[..., Iterator[SampleBlock]]


def rules(delay_s: float) -> UnitRules:
    """Limits that 60 µm at 1× are within."""
    delay = rule_of(delay_s, 30.0)
    order1, span = (LimitRule(Limits(limit), delay) for limit in (100.0, 200.0))
    return UnitRules(bearings={"UJB": {"shaft_order1": order1, "shaft_overall": span}})


def known_after(
    unit: Unit, blocks: Blocks, rows: FloatArray, step_s: float
) -> dict[tuple[str, float], float]:
    """How long after a step each alarm is raised, by kind and delay."""
    monitor = UnitMonitor(unit, AnalysisSettings())
    boards = {delay_s: UnitAlarms(unit, rules(delay_s)) for delay_s in DELAYS_S}
    found: dict[tuple[str, float], float] = {}
    for block in blocks(rows, n_each=600):
        results = list(monitor.steps(block))
        for delay_s, board in boards.items():
            for told in board.take(block, results, block.stop_ns):
                for event in (e for e in told.events if e.change == "raised"):
                    found[event.identity.kind, delay_s] = block.stop_ns / 1e9 - step_s
    return found


EVERY = [(late_s, factor) for late_s in np.arange(0.5, 12.5) for factor in (1.7, 3.0)]


@pytest.mark.parametrize("steps", first_fast(1, [[(0.5, 1.7), (7.5, 3.0)], EVERY]))
def test_a_step_of_the_shafts_vibration_is_an_alarm_within_half_a_minute_and_its_delay(
    unit, blocks, signals, steps
):
    kinds = [f"{name}_shaft_{axis}" for name in ("order1", "overall") for axis in "xy"]
    for late_s, factor in steps:
        step_s, rows = 24.0 + late_s, signals(85.0)
        after = rows[:2, round(step_s * 600) :]
        after += (factor - 1.0) * (after - 2000.0)

        found = known_after(unit, blocks, rows, step_s)

        assert set(found) == {(kind, delay_s) for kind in kinds for delay_s in DELAYS_S}
        for (kind, delay_s), after_s in found.items():
            assert delay_s <= after_s <= delay_s + WITHIN_S, (late_s, kind)


def test_a_bump_that_is_shorter_than_the_delay_is_no_alarm(unit, blocks, signals):
    rows = signals(60.0)
    bump = rows[:2, 30 * 600 : 32 * 600]
    bump += 2.0 * (bump - 2000.0)

    found = known_after(unit, blocks, rows, 30.0)

    delays_s = {delay_s for _, delay_s in found}
    assert 0.0 in delays_s
    assert max(delays_s) < 10.0


def test_the_newest_segment_reads_what_the_average_of_a_steady_shaft_reads(unit, blocks, signals):
    monitor = UnitMonitor(unit, AnalysisSettings())
    results = [a for block in blocks(signals(40.0)) for a in monitor.steps(block)]

    newest = results[-1]
    assert [r.time_ns for r in newest.recent] == pytest.approx(
        [newest.time_ns - n * HOP // MAX_PARTS * 1e9 / 600.0 for n in (3, 2, 1, 0)], abs=2
    )
    for each in newest.recent:
        for name, reading in each.readings.items():
            assert reading.value == pytest.approx(newest.readings[name].value, rel=5e-3), name
    assert "overall_bearing_x_mm_s_rms" in newest.recent[-1].readings


@pytest.mark.parametrize(("turn_samples", "n_parts"), [(390.0, 4), (600.0, 2), (3000.0, 1)])
def test_parts_cover_what_is_new_and_have_turns_enough(turn_samples, n_parts):
    start, stop = parts_of(SEGMENT, HOP, turn_samples)

    assert (stop.size, stop[-1]) == (n_parts, SEGMENT)
    assert start[0] <= SEGMENT - HOP
    assert (start[1:] <= stop[:-1]).all()
    assert (stop - start >= min(PART_TURNS * turn_samples, SEGMENT) - 1).all()
