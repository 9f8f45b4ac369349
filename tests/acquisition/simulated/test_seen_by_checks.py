"""What goes wrong in a simulated unit, as the checks of the analysis see it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from acquisition.calibration import ChannelCalibration, UnitCalibration, calibrate
from acquisition.simulated.faults import Fault, FaultKind
from acquisition.simulated.scenario import ChannelScenario, Scenario
from acquisition.simulated.unit import SimulatedUnit
from core.arrays import FloatArray, SampleArray
from core.lines import exact_phasors, tapered
from core.machine import Channel, Measurand, Unit
from core.probe_axes import ProbeAxis
from core.quality import GOOD, Quality, Reading, Reason, bad, missing, uncertain
from core.sensor_checks import (
    DEFAULT_LIMITS,
    axes_quality,
    backward_share,
    quietest_rms,
    signal_quality,
)
from core.shaft_centre import ShaftCentre, locate_shaft
from core.transducers import displacement_factor

BuildUnit = Callable[..., SimulatedUnit]
SEGMENT = 8192
PROBE = ChannelCalibration(20.0, -250.0, -18.0, -2.0)


def segment(
    build_unit: BuildUnit, calibration: UnitCalibration, scenario: Scenario
) -> tuple[FloatArray, tuple[Quality, ...]]:
    block = calibrate(build_unit(scenario).advance(SEGMENT), calibration)
    return block.samples.astype(np.float64), block.channel_quality


@pytest.mark.parametrize(
    ("kind", "expected"),
    [(FaultKind.STUCK, bad(Reason.STUCK)), (FaultKind.DEAD, bad(Reason.DEAD))],
)
def test_a_bearing_channel_that_stops_is_found_and_no_other_blamed(
    build_unit: BuildUnit,
    calibration: UnitCalibration,
    full_load: Scenario,
    kind: FaultKind,
    expected: Quality,
) -> None:
    faulty = replace(full_load, channels={"UJB_vx": ChannelScenario(faults=(Fault(kind),))})
    samples, _ = segment(build_unit, calibration, faulty)
    rms, mean = quietest_rms(samples), samples.mean(axis=1)

    found = [
        signal_quality(float(r), float(m), c.unit_per_count, True, DEFAULT_LIMITS)
        for r, m, c in zip(rms, mean, calibration.channels, strict=True)
    ]

    assert found[2] == expected
    assert [q for n, q in enumerate(found) if n != 2] == [GOOD] * 11


@pytest.mark.parametrize(
    ("exchanged", "expected"),
    [
        ((), (GOOD, GOOD)),
        ((("UJB_ux", "UJB_uy"),), (uncertain(Reason.SWAPPED_AXES), GOOD)),
        ((("UJB_vx", "UJB_vy"),), (GOOD, uncertain(Reason.SWAPPED_AXES))),
    ],
)
def test_swapped_cables_show_in_the_sense_of_the_orbit(
    build_unit: BuildUnit,
    machine: Unit,
    calibration: UnitCalibration,
    full_load: Scenario,
    exchanged: tuple[tuple[str, str], ...],
    expected: tuple[Quality, Quality],
) -> None:
    samples, _ = segment(build_unit, calibration, replace(full_load, exchanged=exchanged))
    line_hz = np.array([92.3 / 60.0])
    phasors = exact_phasors(tapered(samples[:4]), machine.rate_hz, line_hz)[:, 0]
    phasors *= [displacement_factor(c, line_hz)[0] for c in machine.channels[:4]]

    found = tuple(
        axes_quality(backward_share(abs(x) ** 2, abs(y) ** 2, x * y.conjugate()), 1, DEFAULT_LIMITS)
        for x, y in (phasors[:2], phasors[2:])
    )

    assert found == expected


@pytest.fixture
def four_probes(machine: Unit) -> Unit:
    """UJB with probes across from its own, as channels 12 and 13."""
    opposite = tuple(Channel(f"UJB_{axis}_far", Measurand.GAP_UM, 1) for axis in "xy")
    bearing = replace(
        machine.bearings[0],
        opposite_x="UJB_x_far",
        opposite_y="UJB_y_far",
        opposite_reference_um=(1900.0, 1950.0),
    )
    return replace(
        machine, channels=machine.channels + opposite, bearings=(bearing, *machine.bearings[1:])
    )


@pytest.mark.parametrize("lost", [None, "UJB_ux", "UJB_uy", "UJB_x_far", "UJB_y_far"])
def test_a_warm_bearing_that_loses_a_probe_keeps_its_eccentricity(
    four_probes: Unit, calibration: UnitCalibration, full_load: Scenario, lost: str | None
) -> None:
    warm = replace(full_load.bearings["UJB"], gap_growth_um=70.0)
    faults = {} if lost is None else {lost: ChannelScenario(faults=(Fault(FaultKind.DEAD),))}
    scenario = replace(full_load, bearings={**full_load.bearings, "UJB": warm}, channels=faults)
    wired = replace(calibration, channels=(*calibration.channels, PROBE, PROBE))
    unit = SimulatedUnit(four_probes, wired, scenario, seed=3, start_ns=0)
    true = unit.truth().bearings["UJB"].eccentricity

    centre = located(calibrate(unit.advance(SEGMENT), wired).samples, lost, four_probes)

    assert centre.gap_growth_um.value == pytest.approx(70.0, abs=1.0)
    found = centre.eccentricity_ratio
    assert found.value == pytest.approx(true, abs=0.02)
    assert found.interval_95 is not None
    assert found.interval_95[0] < true < found.interval_95[1]
    assert found.quality == (GOOD if lost is None else uncertain(Reason.REDUCED_PROBES))


def located(samples: SampleArray, lost: str | None, machine: Unit) -> ShaftCentre:
    gaps = {
        channel.id: missing(Reason.SENSOR_FAILURE)
        if channel.id == lost
        else Reading(float(samples[row].mean()))
        for row, channel in enumerate(machine.channels)
    }
    return locate_shaft(
        ProbeAxis(gaps["UJB_ux"], 2000.0, gaps["UJB_x_far"], 1900.0),
        ProbeAxis(gaps["UJB_uy"], 2100.0, gaps["UJB_y_far"], 1950.0),
        machine.bearings[0].clearance_um,
    )
