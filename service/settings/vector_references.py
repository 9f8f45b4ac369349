"""Settings of the 1× vectors of a healthy bearing, with which its vectors are compared."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.settings.base import MisfitError, Settings, refuse_twice
from service.settings.limits import AT_SPEED, StateNames

MAX_UM_PK, FULL_TURN_DEG = 5000.0, 360.0

Vector = Annotated[tuple[float, ...], Field(min_length=1, max_length=2)]
"""1× vector, [amplitude] or [amplitude, phase]: amplitude in µm zero-to-peak, phase in degrees,
positive for lead relative to the key-phase pulse."""

PLACES = ("shaft_x", "shaft_y", "bearing_x", "bearing_y")


class VectorReferenceSettings(Settings):
    """Reference 1× vectors of a healthy bearing, each [amplitude] or [amplitude, phase].

    The amplitude is in µm zero-to-peak; the phase is in degrees, positive for lead.
    """

    states: StateNames = AT_SPEED
    """Operating states in which the reference applies."""

    shaft_x: Vector | None = None
    """1× vector of the shaft in x; example: [60.0, 135.0]."""

    shaft_y: Vector | None = None
    """1× vector of the shaft in y."""

    bearing_x: Vector | None = None
    """1× vector of the bearing in x; example: [12.0, 135.0]."""

    bearing_y: Vector | None = None
    """1× vector of the bearing in y; example: [11.0, 45.0]."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_twice(("states", n, name) for n, name in enumerate(self.states))
        if all(getattr(self, place) is None for place in PLACES):
            raise MisfitError(f"at least one of {', '.join(PLACES)} must be given", "shaft_x")
        for place, vector in self.vectors().items():
            if not 0.0 <= vector[0] <= MAX_UM_PK:
                raise MisfitError(f"amplitude must be 0 to {MAX_UM_PK:g} µm", place, 0)
            if len(vector) == 2 and abs(vector[1]) > FULL_TURN_DEG:
                limit = f"phase must be -{FULL_TURN_DEG:g} to {FULL_TURN_DEG:g} degrees"
                raise MisfitError(limit, place, 1)
        return self

    def vectors(self) -> dict[str, Vector]:
        """Return the configured vectors by measuring point, such as "shaft_x"."""
        found = {place: getattr(self, place) for place in PLACES}
        return {place: vector for place, vector in found.items() if vector is not None}
