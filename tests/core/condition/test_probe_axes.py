"""Where the shaft runs, from two, three or four probes, and how well that is known."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from core.condition.probe_axes import ProbeAxis
from core.condition.shaft_centre import locate_shaft
from core.machine.unit import GapAccuracy
from core.quality import GOOD, Reading, Reason, bad, missing, uncertain

CLEARANCE_UM = 200.0
ACCURACY = GapAccuracy()
LOST = missing(Reason.SENSOR_FAILURE)


def gaps(
    x_um: float, y_um: float, growth_um: float = 0.0, lost: tuple[str, ...] = ()
) -> tuple[ProbeAxis, ProbeAxis]:
    """Both axes of a bearing whose reference gaps are 2000, 1900, 2100 and 1950 µm."""
    values = {
        "near_x": 2000.0 - x_um + growth_um,
        "far_x": 1900.0 + x_um + growth_um,
        "near_y": 2100.0 - y_um + growth_um,
        "far_y": 1950.0 + y_um + growth_um,
    }
    reading = {name: LOST if name in lost else Reading(v) for name, v in values.items()}
    return (
        ProbeAxis(reading["near_x"], 2000.0, reading["far_x"], 1900.0),
        ProbeAxis(reading["near_y"], 2100.0, reading["far_y"], 1950.0),
    )


def located(*args: Any, **options: Any) -> Any:
    readings, _ = locate_shaft(*args, **options)
    return SimpleNamespace(**readings)


def number(reading: Reading) -> float:
    assert reading.value is not None
    return reading.value


def standard(reading: Reading) -> float:
    assert reading.u_random is not None
    assert reading.u_systematic is not None
    return math.hypot(reading.u_random, reading.u_systematic)


def test_four_probes_tell_displacement_from_growth_and_two_say_what_they_take_for_it():
    centre = located(*gaps(60.0, -80.0, 35.0), CLEARANCE_UM)

    assert number(centre.shaft_centre_x_um) == pytest.approx(60.0)
    assert number(centre.shaft_centre_y_um) == pytest.approx(-80.0)
    assert number(centre.gap_growth_um) == pytest.approx(35.0)
    assert number(centre.eccentricity_ratio) == pytest.approx(0.5)
    assert number(centre.attitude_angle_deg) == pytest.approx(-53.13, abs=0.01)
    assert centre.eccentricity_ratio.quality == GOOD

    x, y = gaps(60.0, -80.0, 35.0)
    two = replace(x, far=None), replace(y, far=None)
    centre = located(*two, CLEARANCE_UM)

    assert number(centre.shaft_centre_x_um) == pytest.approx(60.0 - 35.0)
    assert abs(number(centre.shaft_centre_x_um) - 60.0) < 2.0 * standard(centre.shaft_centre_x_um)
    assert centre.shaft_centre_x_um.quality == GOOD
    assert centre.gap_growth_um.quality == bad(Reason.NOT_MEASURED)


@pytest.mark.parametrize("lost", ["near_x", "far_x", "near_y", "far_y"])
def test_a_lost_probe_of_four_costs_certainty_and_no_more(lost):
    whole = located(*gaps(60.0, -80.0, 35.0), CLEARANCE_UM)
    fewer = located(*gaps(60.0, -80.0, 35.0, (lost,)), CLEARANCE_UM)

    assert number(fewer.shaft_centre_x_um) == pytest.approx(60.0)
    assert number(fewer.shaft_centre_y_um) == pytest.approx(-80.0)
    assert number(fewer.gap_growth_um) == pytest.approx(35.0)
    assert fewer.eccentricity_ratio.quality == uncertain(Reason.REDUCED_PROBES)
    assert standard(fewer.eccentricity_ratio) > standard(whole.eccentricity_ratio)


def test_without_any_pair_the_last_known_growth_stands_in_and_may_have_changed():
    axes = gaps(60.0, -80.0, 35.0, ("far_x", "near_y"))
    never = located(*axes, CLEARANCE_UM)
    lately = located(*axes, CLEARANCE_UM, last_growth=Reading(35.0, interval_95=(30.0, 40.0)))

    assert number(lately.shaft_centre_x_um) == pytest.approx(60.0)
    assert number(lately.shaft_centre_y_um) == pytest.approx(-80.0)
    assert number(never.shaft_centre_x_um) == pytest.approx(60.0 - 35.0)
    assert number(never.shaft_centre_y_um) == pytest.approx(-80.0 + 35.0)
    assert standard(lately.shaft_centre_x_um) < standard(never.shaft_centre_x_um)
    # gain 5 % of 25 µm, reference 5 µm, growth 5 + 20 µm, all uniform
    assert standard(lately.shaft_centre_x_um) == pytest.approx(
        math.hypot(1.25, 5.0, 25.0) / math.sqrt(3.0)
    )


def test_a_doubtful_gap_or_an_axis_without_probes_leaves_what_is_known_without_it():
    centre = located(*gaps(60.0, -80.0, 0.0, ("near_x", "far_x")), CLEARANCE_UM)

    assert number(centre.shaft_centre_y_um) == pytest.approx(-80.0)
    for reading in (centre.shaft_centre_x_um, centre.eccentricity_ratio, centre.attitude_angle_deg):
        assert reading.quality == bad(Reason.SENSOR_FAILURE)

    x, y = gaps(30.0, -40.0)
    doubtful = replace(x.near, quality=uncertain(Reason.LOW_COVERAGE))
    centre = located(replace(x, near=doubtful, far=None), replace(y, far=None), CLEARANCE_UM)

    assert centre.eccentricity_ratio.quality == uncertain(Reason.LOW_COVERAGE)
    assert centre.shaft_centre_y_um.quality.reason is Reason.OK


def test_a_centred_shaft_has_an_eccentricity_of_zero_and_any_angle():
    centre = located(*gaps(0.0, 0.0), CLEARANCE_UM)

    assert number(centre.eccentricity_ratio) == 0.0
    assert standard(centre.eccentricity_ratio) > 0.0
    assert centre.eccentricity_ratio.interval_95 is not None
    assert centre.eccentricity_ratio.interval_95[0] == 0.0
    assert centre.attitude_angle_deg.u_systematic == pytest.approx(103.9, abs=0.1)


def test_scatter_of_a_gap_is_kept_apart_from_what_is_always_wrong():
    x, y = gaps(60.0, -80.0)
    noisy = replace(x, near=replace(x.near, u_random=4.0))
    centre = located(noisy, y, CLEARANCE_UM)

    assert centre.shaft_centre_x_um.u_random == pytest.approx(2.0)
    assert centre.shaft_centre_y_um.u_random == 0.0
    assert (
        centre.shaft_centre_x_um.u_systematic
        == located(x, y, CLEARANCE_UM).shaft_centre_x_um.u_systematic
    )


def drawn(random: np.random.Generator, lost: tuple[str, ...]) -> tuple[Any, float, float]:
    """A bearing as limits allow it, what is found, and its true eccentricity and angle."""
    radius_um, angle_deg = random.uniform(60.0, 160.0), random.uniform(-180.0, 180.0)
    angle = math.radians(angle_deg)
    true_um = radius_um * np.array([math.cos(angle), math.sin(angle)])
    growth_um = random.uniform(-80.0, 80.0)
    uneven_um = random.uniform(-1.0, 1.0) * ACCURACY.growth_asymmetry_um
    grown_um = np.repeat([growth_um, growth_um + uneven_um], 2)
    moved_um = np.array([-true_um[0], true_um[0], -true_um[1], true_um[1]])
    gain = 1.0 + ACCURACY.gain * random.uniform(-1.0, 1.0, 4)
    reference_um = ACCURACY.reference_um * random.uniform(-1.0, 1.0, 4)
    read_um = 2000.0 + gain * (moved_um + grown_um) + reference_um
    names = ("near_x", "far_x", "near_y", "far_y")
    near_x, far_x, near_y, far_y = (
        LOST if name in lost else Reading(float(gap))
        for name, gap in zip(names, read_um, strict=True)
    )
    x, y = ProbeAxis(near_x, 2000.0, far_x, 2000.0), ProbeAxis(near_y, 2000.0, far_y, 2000.0)
    # growth was last seen by four probes, and has changed since
    seen_um = growth_um + ACCURACY.growth_change_um * random.uniform(-1.0, 1.0)
    last = Reading(seen_um, interval_95=(seen_um, seen_um))
    believed_um = CLEARANCE_UM * (1.0 + ACCURACY.clearance * random.uniform(-1.0, 1.0))
    found = located(x, y, believed_um, ACCURACY, last)
    return found, radius_um / CLEARANCE_UM, angle_deg


@pytest.mark.parametrize(
    "lost",
    [(), ("near_x",), ("far_x",), ("near_y",), ("far_y",), ("far_x", "far_y")],
    ids=lambda lost: "+".join(lost) or "none",
)
def test_eccentricity_and_angle_stay_within_their_stated_uncertainty(lost):
    random = np.random.default_rng(11)
    n_runs, inside, off, widths = 1000, np.zeros(2), [], []
    for _ in range(n_runs):
        centre, true_ratio, true_angle_deg = drawn(random, lost)
        for index, (reading, true) in enumerate(
            ((centre.eccentricity_ratio, true_ratio), (centre.attitude_angle_deg, true_angle_deg))
        ):
            error = number(reading) - true
            error = (error + 180.0) % 360.0 - 180.0 if index else error
            inside[index] += abs(error) <= 1.96 * standard(reading)
        off.append(number(centre.eccentricity_ratio) - true_ratio)
        widths.append(standard(centre.eccentricity_ratio))

    # Sums of few uniform errors stay inside more often than normal ones; never less than 93 %.
    assert inside.min() >= 0.93 * n_runs
    # and the statement is no empty one: the errors are as large as it says, within 15 %
    assert np.std(off) == pytest.approx(np.sqrt(np.mean(np.square(widths))), rel=0.15)
