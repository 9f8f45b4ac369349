"""A simulated machine that lives: which life it has, and what goes wrong in it."""

from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, Field, model_validator

from service.settings.base import MisfitError, Settings


class SimulatedDamageSettings(Settings):
    """Damage to one bearing of a simulated life."""

    bearing: Literal["UJB", "LJB", "TJB"]
    """Which bearing."""

    kind: Literal[
        "stiffness_loss",
        "clearance_growth",
        "pivot_wear",
        "oil_degradation",
        "bracket_loosening",
        "probe_gain",
        "accelerometer_gain",
    ]
    """What goes wrong: with the film (the first four), the bracket or the transducers."""

    size: Annotated[float, Field(gt=-1.0, lt=1.0)]
    """Share that is lost in the end: of the film's stiffness, the oil's viscosity, the bracket's
    stiffness; of a gain its relative change, with its sign. Example: 0.2."""

    after_s: Annotated[float, Field(ge=0.0, le=3.2e7)] | None = None
    """Sets in so long after the simulator's start, s."""

    at: AwareDatetime | None = None
    """Or sets in at this time. Example: 2026-03-01T12:00:00Z."""

    ramp_s: Annotated[float, Field(ge=0.0, le=3.2e7)] = 0.0
    """Time from onset to `size`, evenly, s; 0 is a step."""

    directions: Annotated[tuple[Literal["x", "y"], ...], Field(min_length=1)] = ("x", "y")
    """Whose transducers change, for gains."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.after_s is None) == (self.at is None):
            raise MisfitError("needs either after_s or at")
        if self.size == 0.0 or (self.size < 0.0 and not self.kind.endswith("_gain")):
            raise MisfitError("must be above 0; only gains may fall below", "size")
        return self


class SimulatedLifeSettings(Settings):
    """A plant life: its readings of the past, and its samples from now on."""

    life_seed: Annotated[int, Field(ge=0, le=2**63 - 1)] | None = None
    """Which life the machine lives, instead of fixed films. Even ones are of 92.3 r/min, odd ones
    of 90.9 r/min. Starts and stops, load, oil and the shaft's place in its bearings follow from it.
    """

    held_load: Annotated[float, Field(gt=0.0, le=1.0)] | None = None
    """Share of 700 MW at which the machine is kept running from the day before the simulator's
    start; without it, it may stand still. Example: 0.95."""

    damage: tuple[SimulatedDamageSettings, ...] = ()
    """What goes wrong with it."""
