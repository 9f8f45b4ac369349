"""Runout of the shaft under its probes: measured at slow roll, subtracted from the 1× vector.

At slow roll the shaft does not vibrate; the 1× vector of a probe is then the runout of the surface.
Subtraction at speed needs a common phase reference: the mark on the shaft.
"""

import cmath
from collections.abc import Mapping, Sequence
from enum import StrEnum

from core.arrays import ComplexArray
from core.machine.channel import MAX_SLOW_ROLL_FRACTION, Channel
from core.machine.unit import Unit
from core.quality import GOOD
from core.spectra.speed import KeyPhase, Speed, SpeedSource


class RunoutVerdict(StrEnum):
    """Verdict that a slow-roll vector was subtracted (`APPLIED`), or the reason why not."""

    APPLIED = "applied"
    NO_VECTOR = "no_vector"
    OTHER_PROBE = "other_probe"
    NOT_SLOW_ROLL = "not_slow_roll"
    NO_PHASE_REFERENCE = "no_phase_reference"


def runout_verdict(channel: Channel, rated_speed_rpm: float, has_key_phase: bool) -> RunoutVerdict:
    """Return `APPLIED` if a channel's slow-roll vector is valid for its probe, else the reason."""
    vector = channel.slow_roll
    if vector is None:
        return RunoutVerdict.NO_VECTOR
    if vector.probe != channel.probe:
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
    """Return 1× phasors from which the applicable slow-roll vectors are subtracted.

    Runout at other orders is not measured and therefore not corrected.

    Parameters
    ----------
    order1_um_pk
        (n_channels,) phasors at exactly the frequency of `speed`, with the phases at the segment's
        first sample.
    unit, rows
        Unit, and the indices of the rows of the shaft channels.
    speed, key_phase
        Running speed, and rotation during the segment; without a usable key-phase (None), nothing
        is subtracted.

    Returns
    -------
    The phasors, and the verdict for each shaft channel, by id.
    """
    angle_rad = shaft_angle_rad(speed, key_phase)
    cleaned, verdicts = order1_um_pk.copy(), {}
    for row in rows:
        channel, vector = unit.channels[row], unit.channels[row].slow_roll
        verdict = runout_verdict(channel, unit.rated_speed_rpm, angle_rad is not None)
        if vector is not None and angle_rad is not None and verdict is RunoutVerdict.APPLIED:
            surface = vector.phasor_um_pk * cmath.exp(1j * angle_rad)
            cleaned[row] = complex(order1_um_pk[row]) - surface
        verdicts[channel.id] = verdict
    return cleaned, verdicts


def shaft_angle_rad(speed: Speed, key_phase: KeyPhase | None) -> float | None:
    """Return the shaft angle at a segment's first sample; None without a usable phase reference.

    The speed must come from the same key-phase and be good; otherwise the phase of the phasors
    would drift relative to the angle.
    """
    agreed = speed.source is SpeedSource.KEY_PHASE and speed.rpm.quality == GOOD
    return key_phase.shaft_angle_rad if key_phase is not None and agreed else None
