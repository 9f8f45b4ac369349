"""Runout taken off all shaft channels of one segment."""

from collections.abc import Mapping, Sequence

from core.arrays import ComplexArray
from core.machine.unit import Unit
from core.quality import GOOD
from core.spectra.key_phase import KeyPhase
from core.spectra.runout import RunoutVerdict, take_off_runout
from core.spectra.speed import Speed, SpeedSource


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
        line = take_off_runout(
            complex(order1_um_pk[row]),
            channel.slow_roll,
            channel.probe,
            unit.rated_speed_rpm,
            angle_rad,
        )
        cleaned[row], verdicts[channel.id] = line.phasor_um_pk, line.verdict
    return cleaned, verdicts


def shaft_angle_rad(speed: Speed, key_phase: KeyPhase | None) -> float | None:
    """Angle of the shaft at a segment's first sample, where phasors can be told by it.

    A shaft angle without the undoubted speed of the same pulses is none: the phasors' phase would
    drift away from it.
    """
    agreed = speed.source is SpeedSource.KEY_PHASE and speed.rpm.quality == GOOD
    return key_phase.shaft_angle_rad if key_phase is not None and agreed else None
