"""Where the shaft runs, from two probe gaps."""

import pytest

from core.quality import Reading, Reason, bad, missing, uncertain
from core.shaft_centre import shaft_centre

REFERENCE_UM = (2000.0, 1900.0)


def test_a_smaller_gap_is_a_shaft_nearer_to_the_probe() -> None:
    centre = shaft_centre((Reading(1970.0), Reading(1940.0)), REFERENCE_UM, 200.0)
    assert (centre.x_um.value, centre.y_um.value) == (30.0, -40.0)
    assert centre.eccentricity_ratio.value == pytest.approx(0.25)
    assert centre.attitude_angle_deg.value == pytest.approx(-53.13, abs=0.01)


def test_a_lost_probe_leaves_the_other_axis_but_no_eccentricity() -> None:
    lost = missing(Reason.SENSOR_FAILURE)
    centre = shaft_centre((lost, Reading(1940.0)), REFERENCE_UM, 200.0)
    assert centre.y_um.value == -40.0
    for reading in (centre.x_um, centre.eccentricity_ratio, centre.attitude_angle_deg):
        assert reading.quality == bad(Reason.SENSOR_FAILURE)


def test_doubt_about_one_gap_is_doubt_about_the_position() -> None:
    doubtful = Reading(1970.0, uncertain(Reason.LOW_COVERAGE))
    centre = shaft_centre((doubtful, Reading(1940.0)), REFERENCE_UM, 200.0)
    assert centre.eccentricity_ratio.quality == uncertain(Reason.LOW_COVERAGE)
    assert centre.y_um.quality.reason is Reason.OK


@pytest.mark.parametrize("clearance_um", [0.0, -1.0, float("nan")])
def test_a_clearance_that_is_not_positive_is_refused(clearance_um: float) -> None:
    with pytest.raises(ValueError, match="clearance must be positive"):
        shaft_centre((Reading(1.0), Reading(1.0)), REFERENCE_UM, clearance_um)
