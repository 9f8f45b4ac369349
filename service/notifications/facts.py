"""What was known around an alarm when it was written down to be told."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from core.alarms.alarm import AlarmIdentity
from core.alarms.kinds import ALARM_KINDS, FILM_KINDS
from core.change.film_judge import FilmNews
from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from service.live.live_view import LiveView

CONDITION = ("speed_rpm", "power_mw", "eccentricity_ratio", "oil_temperature_c")
"""What a film's stiffness depends on, as far as it is measured."""


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

NewestFilm = Callable[[str, str], FilmNews | None]
"""What is said of the films of a bearing of a unit."""


class Around:
    """Finds it in the newest results of the alarm's bearing, if the alarm is about one."""

    def __init__(self, live: LiveView) -> None:
        self._live = live
        self._newest_film: NewestFilm = lambda unit, bearing: None  # noqa: ARG005

    def watch_films(self, newest: NewestFilm) -> None:
        """Look also at what is said of films, once they are watched."""
        self._newest_film = newest

    def __call__(self, identity: AlarmIdentity) -> Surroundings:
        """Look around one alarm."""
        assessment = self._live.assessment(identity.unit, identity.subject)
        if assessment is None:
            return Surroundings()
        condition = assessment.condition
        return Surroundings(
            uncertainty=self._uncertainty(identity, assessment),
            state=condition.state.name.lower() if condition else None,
            condition=list(_facts(assessment)),
        )

    def _uncertainty(self, identity: AlarmIdentity, assessment: Assessment) -> float | None:
        if identity.kind in FILM_KINDS:
            news = self._newest_film(identity.unit, identity.subject)
            return news.findings[FILM_KINDS.index(identity.kind)].change_std if news else None
        kind = ALARM_KINDS.get(identity.kind)
        measured = assessment.readings.get(kind.reading or "") if kind else None
        return measured.u_random if measured else None


def _facts(assessment: Assessment) -> Iterator[Fact]:
    for name in CONDITION:
        reading = assessment.readings[name]
        if reading.value is not None:
            yield Fact(name, LABELS[name], reading.value, UNITS[name], reading.u_random)


LABELS = {quantity.name: quantity.label for quantity in CATALOGUE}
UNITS = {quantity.name: quantity.unit for quantity in CATALOGUE}
