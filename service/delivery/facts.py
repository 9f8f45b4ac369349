"""What was known around an alarm when it was written down to be told."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from core.alarms.alarm import AlarmIdentity, AlarmKind
from core.quantities import CATALOGUE
from service.live import LiveView

CONDITION = ("speed_rpm", "power_mw", "eccentricity_ratio", "oil_temperature_c")
"""What a film's stiffness depends on, as far as it is measured."""

MEASURED = {
    AlarmKind.SHAFT_X: "order1_shaft_x_um_pk",
    AlarmKind.SHAFT_Y: "order1_shaft_y_um_pk",
    AlarmKind.OIL_TEMPERATURE: "oil_temperature_c",
}
"""The quantity that an alarm's value is a reading of."""


@dataclass(frozen=True)
class Fact:
    """One number.

    Parameters
    ----------
    uncertainty
        Standard uncertainty in the unit of the value; None where it is not known.
    """

    name: str
    label: str
    value: float
    unit: str
    uncertainty: float | None = None


@dataclass(frozen=True)
class Surroundings:
    """What goes with an alarm beside its own value.

    Parameters
    ----------
    uncertainty
        Standard uncertainty of the alarm's value; None where it is not known.
    state
        Operating state in a word; None where it is not known.
    condition
        Speed, power, eccentricity and oil temperature, those that are measured.
    """

    uncertainty: float | None = None
    state: str | None = None
    condition: Sequence[Fact] = ()


LookAround = Callable[[AlarmIdentity], Surroundings]


def look_around(live: LiveView) -> LookAround:
    """Take it from the newest result of the alarm's bearing, if the alarm is about one."""

    def look(identity: AlarmIdentity) -> Surroundings:
        assessment = live.assessment(identity.unit, identity.subject)
        if assessment is None:
            return Surroundings()
        found = {name: assessment.readings[name] for name in CONDITION}
        measured = assessment.readings.get(MEASURED.get(identity.kind, ""))
        state = assessment.condition.state.name.lower() if assessment.condition else None
        return Surroundings(
            uncertainty=measured.u_random if measured else None,
            state=state,
            condition=[
                Fact(name, LABELS[name], reading.value, UNITS[name], reading.u_random)
                for name, reading in found.items()
                if reading.value is not None
            ],
        )

    return look


LABELS = {quantity.name: quantity.label for quantity in CATALOGUE}
UNITS = {quantity.name: quantity.unit for quantity in CATALOGUE}
