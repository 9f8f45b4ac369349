"""Parts of the scenario of a simulated unit at one time of its life, to simulate samples."""

from collections.abc import Iterator

import numpy as np

from acquisition.simulated.life.excitation import (
    VORTEX_FORCE_N,
    has_vortex,
    hydraulic_force_n,
)
from acquisition.simulated.life.truth import BearingMoments
from acquisition.simulated.plant.scenario import (
    BearingScenario,
    ChannelScenario,
    HydraulicNoise,
    TransducerNoise,
    VortexRope,
)
from core.arrays import FloatArray
from core.machine.unit import Bearing

TRANSDUCER_NOISE = TransducerNoise(gap_um_rms=1.2, accelerometer_g_per_sqrt_hz=5e-6)
"""Realistic transducer noise of the accuracy benchmark."""

HYDRAULIC_CUTOFF_HZ = 20.0
"""Cutoff of the hydraulic force, well above the harmonics near which stiffness is measured."""


def hydraulic_noise(load: float) -> HydraulicNoise:
    """Return the broadband hydraulic force at a load, given as a share of rated power."""
    return HydraulicNoise(float(hydraulic_force_n(np.array([load]))[0]), HYDRAULIC_CUTOFF_HZ)


def vortex_rope(load: float) -> VortexRope:
    """Return the vortex rope at a load, given as a share of rated power.

    Its force is zero outside `VORTEX_LOADS`.
    """
    return VortexRope(VORTEX_FORCE_N * float(has_vortex(np.array([load]))[0]))


def bearing_at(
    truth: BearingMoments, row: int, grows: bool, usual_clearance_um: float
) -> BearingScenario:
    """Return the scenario of one bearing at one row.

    Parameters
    ----------
    grows
        Whether the gaps include thermal growth.
    usual_clearance_um
        Clearance at zero gap growth.
    """
    x_um, y_um = (float(x) for x in truth.centre_um[:, row])
    error_x_um, error_y_um = _position_error_um(truth, row).tolist()
    return BearingScenario(
        film=truth.film.at(row),
        centre_x_um=x_um,
        centre_y_um=y_um,
        oil_temperature_c=float(truth.oil_temperature_c[row]),
        gap_growth_um=float(truth.clearance_um[row]) - usual_clearance_um if grows else 0.0,
        bracket_stiffness_factor=float(truth.altered.bracket[row]),
        position_error_um=(error_x_um, error_y_um),
        oil_temperature_error_c=float(truth.chain.oil_error_c[row]),
    )


def channels_at(
    truth: BearingMoments, row: int, bearing: Bearing
) -> Iterator[tuple[str, ChannelScenario]]:
    """Yield the id and the true properties of each transducer of a bearing at row `row` of `truth`.

    Opposite probes are included.
    """
    probe_gain, accelerometer_gain = _probe_gain(truth, row), _accelerometer_gain(truth, row)
    near, far = bearing.channels[:2], (bearing.opposite_x, bearing.opposite_y)
    for axis in range(2):
        gain, runout = float(probe_gain[axis]), (complex(truth.chain.runout_um_pk[axis]),)
        yield near[axis], ChannelScenario(gain=gain, runout_um_pk=runout)
        if far[axis] is not None:
            yield str(far[axis]), ChannelScenario(gain=gain)
        yield bearing.channels[2 + axis], ChannelScenario(gain=float(accelerometer_gain[axis]))


def _probe_gain(truth: BearingMoments, row: int) -> FloatArray:
    return np.asarray(truth.chain.probe_gain * truth.altered.probe_gain[:, row])


def _accelerometer_gain(truth: BearingMoments, row: int) -> FloatArray:
    """Return the gain including the slow stiffness errors `Chain.ln_k_error`, (2,)."""
    errors = np.exp(truth.chain.ln_k_error[:, row])
    return np.asarray(
        truth.chain.accelerometer_gain * truth.altered.accelerometer_gain[:, row] * errors
    )


def _position_error_um(truth: BearingMoments, row: int) -> FloatArray:
    """Return the position error in µm that reproduces the errors of the readings, (2,).

    It is the error before the probe gain. In the readings, mean gaps have a separate gain, that of
    the four probes combined.
    """
    centre_um, chain = truth.centre_um[:, row], truth.chain
    read_um = chain.gap_gain * truth.altered.probe_gain[:, row] * centre_um
    read_um += chain.position_error_um[:, row]
    return np.asarray(read_um / _probe_gain(truth, row) - centre_um)
