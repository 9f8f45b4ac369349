"""Digital filters with the frequency response of a transducer, for a continuous signal.

A filter has exactly the poles of the response. Its numerator is a least-squares fit to the
frequency response, without the frequency warping of a bilinear transform.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.errors import ConfigError
from core.arrays import ComplexArray, FloatArray
from core.machine.response import HighPass, Resonance, Response, ResponseChain, ResponseTable

EXACT_BAND_HZ = (0.1, 25.0)
"""Frequency band in which a filter matches the transducer response to `TOLERANCE`."""
TOLERANCE = 1e-3

N_TAPS = 6
N_POINTS = 400
CARE_ABOVE_BAND = 1e-3
"""Weight of the fit above the band, which limits the gain of the filter there."""


class ResponseFilter:
    """Filter with the frequency response of one transducer, for successive pieces of a signal.

    The initial filter state is the steady state for a constant signal equal to the first sample.

    Raises ConfigError if the response is a table, or cannot be simulated to `TOLERANCE` within
    `EXACT_BAND_HZ`.
    """

    def __init__(self, response: Response, rate_hz: float) -> None:
        self._stages = [_Stage(*_section(part, rate_hz)) for part in _parts(response)]
        low_hz, high_hz = EXACT_BAND_HZ
        band_hz = np.geomspace(low_hz, min(high_hz, 0.4 * rate_hz), N_POINTS)
        wanted = response.at(band_hz)
        off = np.abs(self.response_at(band_hz, rate_hz) - wanted) / np.abs(wanted).clip(1e-3)
        if not off.max() <= TOLERANCE:
            raise ConfigError(
                f"a simulated transducer deviates from its response by {off.max():.2g} at"
                f" {band_hz[off.argmax()]:.3g} Hz, at most {TOLERANCE:g} is allowed; change the"
                " response or the sampling rate"
            )

    def advance(self, samples: FloatArray) -> FloatArray:
        """Filter the next samples of the signal; return the filtered samples, (n_samples,)."""
        for stage in self._stages:
            samples = stage.advance(samples)
        return samples

    def response_at(self, frequency_hz: FloatArray, rate_hz: float) -> ComplexArray:
        """Return the complex frequency response of the filter at given frequencies, (n_lines,)."""
        factor = np.ones(frequency_hz.shape, dtype=np.complex128)
        for stage in self._stages:
            factor *= _response(stage.numerator, stage.denominator, frequency_hz, rate_hz)
        return factor


@dataclass
class _Stage:
    numerator: FloatArray
    denominator: FloatArray
    state: FloatArray | None = None

    def advance(self, samples: FloatArray) -> FloatArray:
        import scipy.signal  # slow import, not needed at start-up

        if self.state is None:
            self.state = scipy.signal.lfilter_zi(self.numerator, self.denominator) * samples[0]
        filtered, self.state = scipy.signal.lfilter(
            self.numerator, self.denominator, samples, zi=self.state
        )
        return np.asarray(filtered)


def _parts(response: Response) -> list[HighPass | Resonance | ResponseTable]:
    if not isinstance(response, ResponseChain):
        return [response]
    return [inner for part in response.parts for inner in _parts(part)]


def _section(
    response: HighPass | Resonance | ResponseTable, rate_hz: float
) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator coefficients of the digital filter for one response."""
    match response:
        case HighPass(corner_hz, order=1):
            return _fitted(response, [-2.0 * np.pi * corner_hz], order=1, rate_hz=rate_hz)
        case HighPass(corner_hz, order, damping):
            return _fitted(response, _pole_pair(corner_hz, damping), order, rate_hz)
        case Resonance(natural_hz, damping):
            # a resonance above half the sampling rate has no pole in the sampled response
            poles = _pole_pair(natural_hz, damping) if natural_hz < rate_hz / 4.0 else []
            return _fitted(response, poles, order=0, rate_hz=rate_hz)
        case ResponseTable():
            raise ConfigError(
                "a simulated transducer requires a model of its response, got a table"
            )


def _pole_pair(natural_hz: float, damping: float) -> list[complex]:
    omega = 2.0 * np.pi * natural_hz
    return list(np.roots([1.0, 2.0 * damping * omega, omega**2]))


def _fitted(
    response: Response, poles: Sequence[complex], order: int, rate_hz: float
) -> tuple[FloatArray, FloatArray]:
    """Return numerator and denominator of a filter with given poles, `order` zeros at 0 Hz.

    Further zeros are fitted to the frequency response.
    """
    denominator, zeros = _polynomial(np.exp(np.array(poles) / rate_hz)), _polynomial(np.ones(order))
    frequency_hz = np.linspace(0.1, 0.45 * rate_hz, 10 * N_POINTS)
    shape = _response(zeros, denominator, frequency_hz, rate_hz)
    target = response.at(frequency_hz)
    delays = np.exp(-2j * np.pi * np.outer(frequency_hz / rate_hz, np.arange(N_TAPS)))
    care = np.where(frequency_hz <= 1.5 * EXACT_BAND_HZ[1], 1.0, CARE_ABOVE_BAND)
    # relative error, so that all frequencies of a high-pass have equal weight
    taps = _taps(delays * (shape / target * care)[:, np.newaxis], care)
    if not poles:  # a recursive filter: rounding of a convolution depends on the piece length
        denominator = np.array([1.0, 0.0])
    if order == 0:
        taps *= denominator.sum() / taps.sum()  # exact gain at 0 Hz, for a constant gap
    return np.convolve(zeros, taps), denominator


def _polynomial(roots: ComplexArray | FloatArray) -> FloatArray:
    return np.asarray(np.poly(roots).real, dtype=np.float64)


def _taps(columns: ComplexArray, wanted: FloatArray) -> FloatArray:
    """Return the real least-squares solution t of the complex equations columns · t = wanted."""
    taps: FloatArray = np.linalg.lstsq(
        np.vstack([columns.real, columns.imag]),
        np.concatenate([wanted, np.zeros_like(wanted)]),
        rcond=1e-10,
    )[0]
    return taps


def _response(
    numerator: FloatArray, denominator: FloatArray, frequency_hz: FloatArray, rate_hz: float
) -> ComplexArray:
    import scipy.signal  # slow import, not needed at start-up

    return np.asarray(scipy.signal.freqz(numerator, denominator, frequency_hz, fs=rate_hz)[1])
