"""What transducers do to a signal, and how the analysis undoes it."""

import cmath
import math

import numpy as np
import pytest

from core.machine.channel import Channel, Measurand, displacement_factor
from core.machine.response import HighPass, Resonance, Response, ResponseChain, ResponseTable

FREQUENCY_HZ = np.geomspace(0.05, 50.0, 200)
SHEET = ResponseTable((0.1, 1.0, 10.0), (0.5, 1.0, 1.02), (60.0, 5.0, -2.0))
RESPONSES: dict[str, Response] = {
    "order 1": HighPass(0.5),
    "order 2": HighPass(0.5, 2),
    "resonance": Resonance(60.0, 0.1),
    "sheet": SHEET,
    "chain": ResponseChain((HighPass(0.5), Resonance(60.0, 0.1), SHEET)),
}


def test_a_half_hertz_corner_passes_0_61_of_the_vortex_line():
    passed = HighPass(0.5).at(np.array([92.3 / 60.0 / 4.0]))[0]

    assert abs(passed) == pytest.approx(0.61, abs=0.001)
    assert cmath.phase(passed) > 0.0  # a high-pass leads


@pytest.mark.parametrize(
    ("response", "magnitude", "phase_deg"),
    [
        (HighPass(0.5), math.sqrt(0.5), 45.0),
        (HighPass(0.5, 2), math.sqrt(0.5), 90.0),
        (HighPass(0.5, 2, 0.1), 5.0, 90.0),
        (Resonance(0.5, 0.1), 5.0, -90.0),
    ],
)
def test_responses_at_their_own_frequency(response, magnitude, phase_deg):
    factor = response.at(np.array([0.5]))[0]

    assert abs(factor) == pytest.approx(magnitude)
    assert math.degrees(cmath.phase(factor)) == pytest.approx(phase_deg)


def test_responses_are_one_where_the_transducer_is_made_for_and_a_chain_multiplies_them():
    far_above, far_below = np.array([500.0]), np.array([0.05])

    assert HighPass(0.5).at(far_above)[0] == pytest.approx(1.0, abs=1e-3)
    assert HighPass(0.5, 2).at(far_above)[0] == pytest.approx(1.0, abs=2e-3)
    assert Resonance(500.0, 0.1).at(far_below)[0] == pytest.approx(1.0, abs=1e-4)

    product = HighPass(0.5).at(FREQUENCY_HZ) * Resonance(60.0, 0.1).at(FREQUENCY_HZ)

    chain = ResponseChain((HighPass(0.5), ResponseChain((Resonance(60.0, 0.1),))))

    assert chain.at(FREQUENCY_HZ) == pytest.approx(product)
    assert ResponseChain(()).at(FREQUENCY_HZ) == pytest.approx(np.ones(200))


def test_a_sheet_is_met_at_its_points_and_between_them_a_phase_goes_the_short_way_round():
    at_points = SHEET.at(np.array(SHEET.frequency_hz))
    everywhere = SHEET.at(FREQUENCY_HZ)

    assert np.abs(at_points) == pytest.approx(SHEET.magnitude)
    assert np.degrees(np.angle(at_points)) == pytest.approx(SHEET.phase_deg)
    assert np.all(np.diff(np.abs(everywhere)) >= -1e-12)
    assert everywhere[0] == pytest.approx(at_points[0])
    assert everywhere[-1] == pytest.approx(at_points[-1])

    wrapping = ResponseTable((1.0, 2.0), (1.0, 1.0), (179.0, -179.0))

    assert wrapping.at(np.array([math.sqrt(2.0)]))[0] == pytest.approx(-1.0)


@pytest.mark.parametrize("measurand", [m for m in Measurand if m != Measurand.KEY_PHASE_V])
@pytest.mark.parametrize("name", RESPONSES)
def test_the_analysis_takes_out_what_the_transducer_put_in(name, measurand):
    plain = Channel("vx", measurand, -1)
    real = Channel("vx", measurand, -1, RESPONSES[name])

    reading = RESPONSES[name].at(FREQUENCY_HZ) / displacement_factor(plain, FREQUENCY_HZ)

    assert reading * displacement_factor(real, FREQUENCY_HZ) == pytest.approx(np.ones(200))
