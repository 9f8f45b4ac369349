"""Evaluation zones after ISO 20816-5, filled in by whoever owns the standard; and references."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from service.settings.base import MisfitError, Settings, refuse_twice
from service.settings.limits import (
    AT_SPEED,
    RegionSettings,
    StateNames,
    WatchSettings,
    refuse_overlap,
)

Boundary = Annotated[float, Field(gt=0.0, le=10_000.0)]


class ZoneTableSettings(RegionSettings):
    """Boundaries of the zones in some operating states or condition cells."""

    states: StateNames = AT_SPEED
    """Operating states in which they hold. In a condition without a table the alarm is suppressed
    by design; where it is not known, the strictest table that may hold does."""

    a_b: Boundary
    """Boundary between zones A and B, in the unit of the measurement."""

    b_c: Boundary
    """Boundary between B and C, above a_b; beyond it the alarm is an alert."""

    c_d: Boundary
    """Boundary between C and D, above b_c; beyond it the alarm is a danger."""

    deadband: Annotated[float, Field(ge=0.0, le=10_000.0)] | None = None
    """How far below a boundary the value must fall for its zone to be left; without it a twentieth
    of a_b; example: 5.0."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.b_c <= self.a_b:
            raise MisfitError(f"must be above a_b, {self.a_b:g}", "b_c")
        if self.c_d <= self.b_c:
            raise MisfitError(f"must be above b_c, {self.b_c:g}", "c_d")
        if self.deadband is not None and self.deadband >= self.b_c:
            raise MisfitError(f"must be below b_c, {self.b_c:g}", "deadband")
        return self


class ZoneSettings(WatchSettings):
    """Zones of one measurement."""

    table: Annotated[tuple[ZoneTableSettings, ...], Field(min_length=1, max_length=100)]
    """A table for each group of operating states or condition cells; at most 100."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_overlap(self.table, AT_SPEED)
        return self


class ZonesSettings(Settings):
    """Evaluation zones by measurement. padwatch carries no numbers of the standard."""

    shaft_um_pp: ZoneSettings | None = None
    """Relative shaft displacement, peak-to-peak, µm, in x and in y each."""

    shaft_max_um_pk: ZoneSettings | None = None
    """Farthest excursion of the shaft from its mean place in any direction, µm zero-to-peak."""

    bearing_mm_s_rms: ZoneSettings | None = None
    """Velocity of the bearing housing, mm/s rms, in x and in y each."""


MAX_UM_PK, FULL_TURN_DEG = 5000.0, 360.0

Vector = Annotated[tuple[float, ...], Field(min_length=1, max_length=2)]
"""[amplitude] or [amplitude, phase]: µm zero-to-peak, degrees by which it leads the key-phase."""

PLACES = ("shaft_x", "shaft_y", "bearing_x", "bearing_y")


class VectorReferenceSettings(Settings):
    """1× vectors of a bearing that is well: [µm 0-pk] or [µm 0-pk, degrees]."""

    states: StateNames = AT_SPEED
    """Operating states in which they hold."""

    shaft_x: Vector | None = None
    """Of the shaft in x; example: [60.0, 135.0]."""

    shaft_y: Vector | None = None
    """Of the shaft in y."""

    bearing_x: Vector | None = None
    """Of the bearing in x; example: [12.0, 135.0]."""

    bearing_y: Vector | None = None
    """Of the bearing in y; example: [11.0, 45.0]."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse_twice(("states", n, name) for n, name in enumerate(self.states))
        if all(getattr(self, place) is None for place in PLACES):
            raise MisfitError(f"gives no vector: give one of {', '.join(PLACES)}", "shaft_x")
        for place, vector in self.vectors().items():
            if not 0.0 <= vector[0] <= MAX_UM_PK:
                raise MisfitError(f"amplitude must be 0 to {MAX_UM_PK:g} µm", place, 0)
            if len(vector) == 2 and abs(vector[1]) > FULL_TURN_DEG:
                limit = f"phase must be -{FULL_TURN_DEG:g} to {FULL_TURN_DEG:g} degrees"
                raise MisfitError(limit, place, 1)
        return self

    def vectors(self) -> dict[str, Vector]:
        """Those that are given, by place."""
        found = {place: getattr(self, place) for place in PLACES}
        return {place: vector for place, vector in found.items() if vector is not None}
