"""The simulator applies a transducer's response, the analysis takes it out again."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from acquisition.calibration import UnitCalibration, calibrate
from acquisition.simulated.scenario import ChannelScenario, Scenario, VortexRope
from acquisition.simulated.unit import SimulatedUnit
from core.lines import exact_phasors, tapered
from core.machine import Channel, Unit
from core.transducer_response import HighPass, Resonance, Response, ResponseChain, ResponseTable
from core.transducers import displacement_factor

BuildUnit = Callable[..., SimulatedUnit]
VORTEX_HZ = 0.25 * 92.3 / 60.0
UJB_VX = 2
CORNER = HighPass(0.5)
POINTS_HZ = np.geomspace(0.05, 50.0, 31)
SHEET = ResponseTable(
    tuple(POINTS_HZ.tolist()),
    tuple(np.abs(CORNER.at(POINTS_HZ)).tolist()),
    tuple(np.degrees(np.angle(CORNER.at(POINTS_HZ))).tolist()),
)


@pytest.fixture
def vortex_um(
    machine: Unit, calibration: UnitCalibration, quiet: Scenario, build_unit: BuildUnit
) -> Callable[[Response | None, Response | None], complex]:
    """Vortex line of a bearing as found, with the transducer's response and the one believed."""
    rope = replace(quiet, rope=VortexRope(150.0e3, line_width_hz=0.0), unbalance_grade_mm_s=0.0)

    def found(true: Response | None, believed: Response | None) -> complex:
        unit = build_unit(replace(rope, channels={"UJB_vx": ChannelScenario(response=true)}))
        samples = calibrate(unit.advance(2 * 8192), calibration).samples[UJB_VX : UJB_VX + 1]
        line_hz = np.array([VORTEX_HZ])
        phasor = exact_phasors(tapered(samples.astype(np.float64)), machine.rate_hz, line_hz)[0]
        channel = Channel("UJB_vx", machine.channels[UJB_VX].measurand, response=believed)
        return complex((phasor * displacement_factor(channel, line_hz))[0])

    return found


@pytest.mark.parametrize("believed", [CORNER, SHEET], ids=["model", "calibration sheet"])
def test_a_vortex_line_below_the_accelerometer_s_corner_reads_true(
    vortex_um: Callable[[Response | None, Response | None], complex], believed: Response
) -> None:
    true = vortex_um(None, None)

    assert abs(vortex_um(CORNER, believed) / true - 1.0) < 0.003
    assert abs(vortex_um(CORNER, None) / true) == pytest.approx(1.0 - 0.39, abs=0.003)


@pytest.mark.parametrize(
    "response",
    [
        HighPass(0.5, 2),
        HighPass(1.0, 2, 0.5),
        ResponseChain((HighPass(0.3), HighPass(0.2), Resonance(80.0, 0.05))),
    ],
)
def test_other_transducers_are_undone_as_well(
    vortex_um: Callable[[Response | None, Response | None], complex], response: Response
) -> None:
    assert abs(vortex_um(response, response) / vortex_um(None, None) - 1.0) < 0.003
