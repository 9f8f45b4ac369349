"""One moment of a life as a scenario, so that the same bearings can be sampled at 600 Hz."""

import numpy as np

from acquisition.simulated.life.excitation import VORTEX_FORCE_N, has_vortex, hydraulic_force_n
from acquisition.simulated.life.life_truth import BearingLifeTruth, UnitLife
from acquisition.simulated.scenario import (
    BearingScenario,
    ChannelScenario,
    HydraulicNoise,
    Scenario,
    TransducerNoise,
    VortexRope,
)
from core.machine import Bearing, Unit

TRANSDUCER_NOISE = TransducerNoise(gap_um_rms=1.2, accelerometer_g_per_sqrt_hz=5e-6)
"""What the accuracy benchmark calls realistic."""


def scenario_at(
    life: UnitLife,
    time_ns: int,
    machine: Unit,
    gap_growth_share: float = 1.0,
    noise: TransducerNoise = TRANSDUCER_NOISE,
) -> Scenario:
    """What the unit goes through at the newest reading up to a moment, held for as long as wanted.

    Parameters
    ----------
    machine
        The unit to be sampled; its bearings are those of the life. Its clearances should be
        `LifeBearing.told_clearance_um`, for eccentricity to be that of the readings.
    gap_growth_share
        How much of the growth of the shaft all gaps show: 1 as it is, which two probes take for a
        displacement and four do not; 0 for two probes to give what four would.

    Raises
    ------
    ValueError
        If the life has not begun, or the unit is not at speed then.
    KeyError
        If the machine has a bearing that the life has not.
    """
    row = row_at(life, time_ns)
    operation = life.operation
    load = operation.load[row : row + 1]
    vortex_n = VORTEX_FORCE_N * float(has_vortex(load)[0])
    return Scenario(
        bearings={
            bearing.id: _bearing_at(life.truth[bearing.id], row, gap_growth_share)
            for bearing in machine.bearings
        },
        speed_rpm=float(operation.speed_rpm[row]),
        active_power_mw=float(operation.power_mw[row]),
        unbalance_grade_mm_s=float(life.grade_mm_s[row]),
        hydraulic=HydraulicNoise(float(hydraulic_force_n(load)[0]), HYDRAULIC_CUTOFF_HZ),
        rope=VortexRope(vortex_n),
        noise=noise,
        channels={
            channel: ChannelScenario(gain=gain)
            for bearing in machine.bearings
            for channel, gain in _gains_at(life.truth[bearing.id], row, bearing).items()
        },
    )


HYDRAULIC_CUTOFF_HZ = 20.0
"""Turbulence has died down well above the harmonics that stiffness is read between."""


def row_at(life: UnitLife, time_ns: int) -> int:
    """Row of the newest reading up to a moment.

    Raises
    ------
    ValueError
        If there is none, or the unit is not at speed in it.
    """
    row = int(np.searchsorted(life.operation.time_ns, time_ns, side="right")) - 1
    if row < 0:
        raise ValueError(f"the life of unit {life.unit_seed} begins after {time_ns} ns")
    if not life.operation.is_at_speed[row]:
        raise ValueError(f"unit {life.unit_seed} is not at speed at {time_ns} ns")
    return row


def _bearing_at(truth: BearingLifeTruth, row: int, gap_growth_share: float) -> BearingScenario:
    x_um, y_um = (float(x) for x in truth.centre_um[:, row])
    usual_um = float(np.median(truth.clearance_um))
    return BearingScenario(
        film=truth.film.at(row),
        centre_x_um=x_um,
        centre_y_um=y_um,
        oil_temperature_c=float(truth.oil_temperature_c[row]),
        gap_growth_um=gap_growth_share * (float(truth.clearance_um[row]) - usual_um),
        bracket_stiffness_factor=float(truth.altered.bracket[row]),
    )


def _gains_at(truth: BearingLifeTruth, row: int, bearing: Bearing) -> dict[str, float]:
    """Gain by channel, as far as damage has changed it."""
    altered = truth.altered
    gains = np.concatenate([altered.probe_gain, altered.accelerometer_gain])[:, row]
    return {
        channel: float(gain)
        for channel, gain in zip(bearing.channels, gains, strict=True)
        if gain != 1.0
    }
