import numpy as np
import pytest

from acquisition.errors import ConfigError
from acquisition.simulated.response_filter import ResponseFilter
from core.arrays import FloatArray
from core.transducer_response import HighPass, Resonance, Response, ResponseChain, ResponseTable

RATE_HZ = 600.0
ACCELEROMETER = ResponseChain((HighPass(0.5), Resonance(2500.0, 0.02)))
RESPONSES: dict[str, Response] = {
    "accelerometer": ACCELEROMETER,
    "slow charge amplifier": HighPass(0.02, order=2),
    "charge amplifier": HighPass(0.5, order=2),
    "velocity pickup": HighPass(4.5, order=2, damping=0.56),
    "soft mounting": Resonance(60.0, 0.1),
    "chain of chains": ResponseChain((ACCELEROMETER, HighPass(0.3, order=2), HighPass(3.0))),
}


@pytest.mark.parametrize("rate_hz", [600.0, 1200.0])
@pytest.mark.parametrize("name", RESPONSES)
def test_the_samples_have_the_response_of_the_transducer(name: str, rate_hz: float) -> None:
    response = RESPONSES[name]
    frequency_hz = np.geomspace(0.1, 25.0, 100)

    off = ResponseFilter(response, rate_hz).response_at(frequency_hz, rate_hz) - response.at(
        frequency_hz
    )

    assert np.abs(off / response.at(frequency_hz)).max() < 5e-4


@pytest.mark.parametrize("name", RESPONSES)
def test_a_filter_joins_from_piece_to_piece_without_a_seam(name: str) -> None:
    signal: FloatArray = np.random.default_rng(1).standard_normal(3000)
    whole = ResponseFilter(RESPONSES[name], RATE_HZ).advance(signal)
    stream = ResponseFilter(RESPONSES[name], RATE_HZ)

    pieces = [stream.advance(piece) for piece in np.split(signal, [1, 3, 100, 2048])]

    assert np.array_equal(np.concatenate(pieces), whole)


def test_a_standing_gap_leaves_no_transient() -> None:
    passed = ResponseFilter(Resonance(60.0, 0.1), RATE_HZ).advance(np.full(500, 2000.0))
    blocked = ResponseFilter(HighPass(0.5), RATE_HZ).advance(np.full(500, 2000.0))

    assert passed == pytest.approx(2000.0, rel=1e-3)
    assert np.ptp(passed) < 1e-6
    assert np.abs(blocked).max() < 1e-6


def test_a_response_that_samples_cannot_show_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"not within 0\.001, at"):
        ResponseFilter(Resonance(100.0, 0.3), 200.0)
    with pytest.raises(ConfigError, match="needs a model of its response, got a table"):
        ResponseFilter(ResponseTable((0.1, 10.0), (1.0, 1.0), (0.0, 0.0)), RATE_HZ)
