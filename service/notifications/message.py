"""An alarm event as a JSON message, written once and the same for every attempt."""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

from core.alarms.alarm import Alarm, AlarmEvent, AlarmIdentity
from core.alarms.kinds import ALARM_KINDS, FILM_KINDS
from core.change.film_judge import FilmNews
from core.monitor.assessment import Assessment
from core.monitor.catalogue import CATALOGUE
from service.live.live_view import LiveView
from service.runtime.times import rfc3339
from service.settings.alarm_kinds import value_unit

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


FORMAT = 1
"""Raised when a key changes its meaning or goes; new ones may come at any time."""

ALARMS_PAGE = "#/alarms"


@dataclass(frozen=True)
class Plant:
    """The plant as a message names it.

    Parameters
    ----------
    url
        Of the dashboard; None if nobody can reach it.
    """

    name: str
    url: str | None
    unit_names: dict[str, str]


Message = dict[str, Any]
"""A message as a receiver reads it."""


class Composer:
    """Writes messages.

    Parameters
    ----------
    new_id
        Makes identifiers that nobody else has.
    """

    def __init__(
        self, plant: Plant, look: LookAround, new_id: Callable[[], str] = lambda: str(uuid4())
    ) -> None:
        self._plant, self._look, self._new_id = plant, look, new_id

    def alarm(self, alarm: Alarm, event: AlarmEvent, is_active: bool, now_ns: int) -> Message:
        """Tell of an event of an alarm."""
        found = self._look(event.identity)
        return {
            **self._head("alarm", now_ns),
            **_what(event, is_active),
            "raised": None if alarm.raised_ns is None else rfc3339(alarm.raised_ns),
            **_numbers(event, found),
            "unit_name": self._plant.unit_names.get(event.identity.unit),
        }

    def test(self, now_ns: int) -> Message:
        """Tell of nothing, to see whether it arrives."""
        return self._head("test", now_ns)

    def _head(self, type_: str, now_ns: int) -> Message:
        url = self._plant.url
        return {
            "format": FORMAT,
            "id": self._new_id(),
            "type": type_,
            "plant": self._plant.name,
            "written": rfc3339(now_ns),
            "url": None if url is None else f"{url.rstrip('/')}/{ALARMS_PAGE}",
        }


def dumps(message: Message) -> str:
    """Write a message down, in the bytes in which it will be signed and sent."""
    return json.dumps(message, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def loads(body: str) -> Message:
    """Read a message that was written down."""
    message: Message = json.loads(body)
    return message


def _what(event: AlarmEvent, is_active: bool) -> Message:
    identity = event.identity
    return {
        "alarm": identity.id,
        "unit": identity.unit,
        "subject": identity.subject,
        "kind": identity.kind,
        "number": event.number,
        "change": event.change.value,
        "priority": None if event.level is None else event.level.name.lower(),
        "is_active": is_active,
        "state": event.state_after.value,
        "occurrence": event.occurrence,
        "time": rfc3339(event.time_ns),
        "actor": event.actor,
        "reason": str(event.reason),
    }


def _numbers(event: AlarmEvent, found: Surroundings) -> Message:
    kind = event.identity.kind
    return {
        "value": _finite(event.value),
        "uncertainty": _finite(found.uncertainty),
        "limit": _finite(event.limit),
        "value_unit": value_unit(kind),
        "value_is": "ln_change" if kind in FILM_KINDS else "reading",
        "operating_state": found.state,
        "condition": {fact.name: _fact(fact) for fact in found.condition},
    }


def _fact(fact: Fact) -> Message:
    return {
        "label": fact.label,
        "value": _finite(fact.value),
        "unit": fact.unit,
        "uncertainty": _finite(fact.uncertainty),
    }


def _finite(number: float | None) -> float | None:
    """Nothing, where JSON has no number for it."""
    return number if number is not None and math.isfinite(number) else None
