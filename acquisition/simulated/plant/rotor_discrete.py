"""Exact motion of a linear rotor from one sample to the next.

With forces that are constant or a straight line during a step the matrix exponential gives the
motion at the end of it without error, whatever the step.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import scipy.linalg

from acquisition.simulated.plant.rotor import RotorMatrices
from core.arrays import FloatArray


class Hold(StrEnum):
    """How a force runs from one sample to the next.

    A held force is a staircase. Its steps contain the force once more near the sampling rate, which
    folds back on sampling: harmless in displacement and velocity, but at 1.5 Hz and 600 Hz it turns
    the acceleration of a stiffly held bracket by 1.5° and more. A ramp has no such steps.
    """

    ZERO = "zero"
    RAMP = "ramp"


@dataclass(frozen=True)
class DiscreteRotor:
    """``s[n+1] = A s[n] + B f[n]``, ``y[n] = C s[n] + D f[n]``.

    The state s is (x, dx/dt) if forces are held, and that less a share of the force if they ramp.

    Parameters
    ----------
    transition, input_map, output_map, feedthrough
        A (n_states, n_states), B (n_states, n_forces), C (n_outputs, n_states) and
        D (n_outputs, n_forces).
    """

    transition: FloatArray
    input_map: FloatArray
    output_map: FloatArray
    feedthrough: FloatArray


def state_matrix(matrices: RotorMatrices) -> FloatArray:
    """Continuous state matrix of (x, dx/dt), (20, 20) (Brito et al., equation 7)."""
    damping = matrices.damping + matrices.speed_rad_s * matrices.gyroscopic
    n = matrices.mass.shape[0]
    return np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [
                -np.linalg.solve(matrices.mass, matrices.stiffness),
                -np.linalg.solve(matrices.mass, damping),
            ],
        ]
    )


def discretize(
    matrices: RotorMatrices,
    force_map: FloatArray,
    output_map: FloatArray,
    rate_hz: float,
    hold: Hold = Hold.ZERO,
) -> DiscreteRotor:
    """Integrate exactly over one step.

    Parameters
    ----------
    force_map
        (10, n_forces) generalized force of each input.
    output_map
        (n_outputs, 20) outputs from displacement and velocity.

    Raises
    ------
    ValueError
        If the rate is not positive.
    """
    if not rate_hz > 0.0:
        raise ValueError(f"sampling rate must be above 0 Hz, got {rate_hz}")
    transition, held, ramped = _step(matrices, force_map, rate_hz)
    if hold is Hold.ZERO:
        still = np.zeros((output_map.shape[0], force_map.shape[1]))
        return DiscreteRotor(transition, held, output_map, still)
    # s = (x, dx/dt) − ramped f takes f[n+1] out of the recursion (Franklin, Powell, Workman,
    # Digital Control of Dynamic Systems, triangle hold)
    driven = held + transition @ ramped - ramped
    return DiscreteRotor(transition, driven, output_map, output_map @ ramped)


def _step(
    matrices: RotorMatrices, force_map: FloatArray, rate_hz: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Transition, effect of a constant force, and effect of a force that grows from 0 to 1."""
    n_states, n_forces = 2 * matrices.mass.shape[0], force_map.shape[1]
    held, ramped = n_states + n_forces, n_states + 2 * n_forces
    # The exponential of A bordered by B and integrators holds its integrals (Van Loan, 1978)
    bordered = np.zeros((ramped, ramped))
    bordered[:n_states, :n_states] = state_matrix(matrices) / rate_hz
    bordered[n_states // 2 : n_states, n_states:held] = (
        np.linalg.solve(matrices.mass, force_map) / rate_hz
    )
    bordered[n_states:held, held:] = np.eye(n_forces)
    step = scipy.linalg.expm(bordered)[:n_states]
    return step[:, :n_states], step[:, n_states:held], step[:, held:]
