"""Runout of the shaft under its probes, measured at slow roll and taken off the 1× line.

At slow roll the shaft does not vibrate; what a probe reads at 1× then is the surface. It can be
taken off at speed only by a phase that both have in common: that of a mark on the shaft.
"""

import cmath
from collections.abc import Mapping, Sequence
from enum import StrEnum

from core.arrays import ComplexArray
from core.machine.channel import MAX_SLOW_ROLL_FRACTION, SlowRollVector
from core.machine.unit import Unit
from core.quality import GOOD
from core.spectra.speed import KeyPhase, Speed, SpeedSource


class RunoutVerdict(StrEnum):
    """Whether a slow-roll vector was taken off, else why not."""

    APPLIED = "applied"
    NO_VECTOR = "no_vector"
    OTHER_PROBE = "other_probe"
    NOT_SLOW_ROLL = "not_slow_roll"
    NO_PHASE_REFERENCE = "no_phase_reference"


def take_off_runout(
    phasor_um_pk: complex,
    vector: SlowRollVector | None,
    probe: str,
    rated_speed_rpm: float,
    shaft_angle_rad: float | None,
) -> tuple[complex, RunoutVerdict]:
    """Take the slow-roll vector off a probe's 1× phasor; leave it as it is where that is no use.

    Only for 1×: nothing is known of the surface at other orders, and the vortex has no runout.

    Parameters
    ----------
    phasor_um_pk
        1× phasor of one segment, relative to its first sample.
    probe
        The probe that is there now.
    shaft_angle_rad
        Angle that the shaft has turned at the first sample since the mark passed the pick-up; none
        without a key-phase.
    """
    verdict = runout_verdict(vector, probe, rated_speed_rpm, shaft_angle_rad is not None)
    if vector is None or shaft_angle_rad is None or verdict is not RunoutVerdict.APPLIED:
        return phasor_um_pk, verdict
    surface = vector.phasor_um_pk * cmath.exp(1j * shaft_angle_rad)
    return phasor_um_pk - surface, verdict


def runout_verdict(
    vector: SlowRollVector | None, probe: str, rated_speed_rpm: float, has_key_phase: bool
) -> RunoutVerdict:
    """Whether a vector may be taken off the readings of a probe, else the first reason why not."""
    if vector is None:
        return RunoutVerdict.NO_VECTOR
    if vector.probe != probe:
        return RunoutVerdict.OTHER_PROBE
    if not 0.0 < vector.speed_rpm <= MAX_SLOW_ROLL_FRACTION * rated_speed_rpm:
        return RunoutVerdict.NOT_SLOW_ROLL
    if not has_key_phase:
        return RunoutVerdict.NO_PHASE_REFERENCE
    return RunoutVerdict.APPLIED


def without_runout(
    order1_um_pk: ComplexArray,
    unit: Unit,
    rows: Sequence[int],
    speed: Speed,
    key_phase: KeyPhase | None,
) -> tuple[ComplexArray, Mapping[str, RunoutVerdict]]:
    """Take the slow-roll vectors off the 1× phasors where they are of use.

    Parameters
    ----------
    order1_um_pk
        (n_channels,) phasors at exactly `speed`, relative to the segment's first sample.
    rows
        Of the shaft channels.

    Returns
    -------
    The phasors, and what was done to each shaft channel, by id.
    """
    angle_rad = shaft_angle_rad(speed, key_phase)
    cleaned, verdicts = order1_um_pk.copy(), {}
    for row in rows:
        channel = unit.channels[row]
        cleaned[row], verdicts[channel.id] = take_off_runout(
            complex(order1_um_pk[row]),
            channel.slow_roll,
            channel.probe,
            unit.rated_speed_rpm,
            angle_rad,
        )
    return cleaned, verdicts


def shaft_angle_rad(speed: Speed, key_phase: KeyPhase | None) -> float | None:
    """Angle of the shaft at a segment's first sample, or None if phasors cannot refer to it.

    A shaft angle without the undoubted speed of the same pulses is none: the phasors' phase would
    drift away from it.
    """
    agreed = speed.source is SpeedSource.KEY_PHASE and speed.rpm.quality == GOOD
    return key_phase.shaft_angle_rad if key_phase is not None and agreed else None
