"""Runout of the shaft under one probe, as it was read at slow roll."""

import cmath
import math
from typing import Annotated

from pydantic import AwareDatetime, Field, StringConstraints

from core.machine.channel import SlowRollVector
from core.units import NS_PER_S
from service.settings.base import Settings

ProbeName = Annotated[str, StringConstraints(min_length=1, max_length=80)]
"""Serial number or any other mark that tells one probe from the next."""


class SlowRollSettings(Settings):
    """A slow-roll vector: what a probe read at 1× while the shaft turned too slowly to vibrate."""

    um_pk: Annotated[float, Field(ge=0.0, le=1000.0)]
    """Amplitude, µm zero-to-peak; example: 8.0."""

    phase_deg: Annotated[float, Field(ge=-360.0, le=360.0)]
    """Phase of the displacement along the bearing's axis when the mark passes the key-phase
    pick-up, degrees, positive where it leads. An instrument that shows phase lag, from the pulse to
    the next positive peak (API 670), gives this with the other sign. Example: 30.0."""

    speed_rpm: Annotated[float, Field(gt=0.0, le=1500.0)]
    """Speed at which it was read, r/min; used only up to a quarter of the rated speed; example:
    8.0."""

    taken: AwareDatetime
    """When it was read, with offset; example: 2026-03-01T10:00:00Z."""

    probe: ProbeName
    """The probe that read it. Another one sees another surface: then it is not used. Example:
    "SN123"."""

    def vector(self, channel: str) -> SlowRollVector:
        """The vector as the numerics see it."""
        return SlowRollVector(
            channel=channel,
            probe=self.probe,
            phasor_um_pk=cmath.rect(self.um_pk, math.radians(self.phase_deg)),
            speed_rpm=self.speed_rpm,
            taken_ns=round(self.taken.timestamp()) * NS_PER_S,
        )
