"""1× vectors against their reference."""

import math

import pytest

from core.alarms.alarm import AlarmLevel
from core.alarms.limits import Limits
from core.alarms.vector_change import OrderVector, VectorReference, vector_condition
from core.condition.operating_state import OperatingState
from core.quality import Reading, Reason, missing

ALERT = AlarmLevel.ALERT
LIMITS = Limits(30.0, 60.0, 2.0)
NO_PHASE = missing(Reason.NOT_MEASURED)
WELL = VectorReference("U1", "UJB", OperatingState.FULL_LOAD, {"shaft_x": OrderVector(60.0, 10.0)})
LENGTH = VectorReference("U1", "UJB", OperatingState.FULL_LOAD, {"shaft_x": OrderVector(60.0)})


def readings(amplitude: Reading | float, phase: Reading | float) -> dict[str, Reading]:
    found = {"order1_shaft_x_um_pk": amplitude, "order1_shaft_x_phase_deg": phase}
    return {n: r if isinstance(r, Reading) else Reading(r) for n, r in found.items()}


def test_a_vector_that_turns_either_way_is_noticed_though_its_length_stays() -> None:
    found = vector_condition(readings(60.0, 70.0), "shaft_x", WELL, LIMITS, None)

    assert found.value == pytest.approx(60.0)  # 60° of an equilateral triangle
    assert found.level is ALERT
    assert found.reason == "above_limit"
    almost = vector_condition(readings(60.0, 350.0), "shaft_x", WELL, LIMITS, None)

    assert almost.value == pytest.approx(2 * 60.0 * math.sin(math.radians(10.0)))


@pytest.mark.parametrize("reference", [WELL, LENGTH])
@pytest.mark.parametrize(("amplitude", "level"), [(80.0, None), (95.0, ALERT), (25.0, ALERT)])
def test_without_a_phase_only_the_length_counts_and_that_is_said(
    reference: VectorReference, amplitude: float, level: AlarmLevel | None
) -> None:
    found = vector_condition(readings(amplitude, NO_PHASE), "shaft_x", reference, LIMITS, None)

    assert (found.level, found.value) == (level, abs(amplitude - 60.0))
    assert found.reason.startswith("amplitude_change")


def test_a_phase_that_is_lost_clears_no_vector_change() -> None:
    found = vector_condition(readings(60.0, NO_PHASE), "shaft_x", WELL, LIMITS, ALERT)

    assert (found.is_known, found.reason) == (False, "no_phase")


def test_without_a_reference_nothing_is_known() -> None:
    for reference, place in ((None, "shaft_x"), (WELL, "bearing_y")):
        there = readings(60.0, 10.0)
        there |= {n.replace("shaft_x", place): r for n, r in there.items()}
        found = vector_condition(there, place, reference, LIMITS, None)
        assert (found.is_known, found.reason, found.suppressed_by) == (False, "no_reference", None)


def test_a_shaft_that_stands_suppresses_its_vector() -> None:
    standing = readings(missing(Reason.STANDSTILL), NO_PHASE)
    found = vector_condition(standing, "shaft_x", WELL, LIMITS, ALERT)

    assert (found.is_known, found.suppressed_by) == (False, "standstill")


@pytest.mark.parametrize("vector", [(math.nan, 0.0), (-1.0, 0.0), (60.0, math.inf)])
def test_a_vector_is_made_of_numbers(vector: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="must be a number"):
        OrderVector(*vector)
