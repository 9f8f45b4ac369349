"""Notification messages: JSON documents about alarm events, identical for every attempt."""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any
from uuid import uuid4

from core.alarms.alarm import Alarm, AlarmEvent, AlarmIdentity
from core.alarms.kinds import ALARM_KINDS, FILM_STIFFNESS
from core.baseline.history import QUANTITIES
from core.change.film_judge import FilmNews
from core.change.settings import percent_of
from core.monitor.assessment import Assessment
from core.monitor.catalogue import BY_NAME
from service.runtime.times import rfc3339
from service.settings.alarm_kinds import value_unit

Message = dict[str, Any]
"""Notification message as a JSON object: values by key."""

FORMAT = 1
"""Version of the message format, incremented if a key is removed or changes its meaning."""

ALARMS_PAGE = "#/alarms"

CONDITION = {
    name: BY_NAME[name]
    for name in ("speed_rpm", "power_mw", "eccentricity_ratio", "oil_temperature_c")
}
"""Quantities in the `condition` of a message, by name."""


FILM_FACTS = {
    "ln_k": ("stiffness", "Stiffness now", 1e-9, "GN/m"),
    "ln_ck": ("damping_over_stiffness", "Damping over stiffness now", 1e3, "ms"),
}
"""Key, label, scale and unit of a film quantity in a message, by its column."""


@dataclass(frozen=True)
class AlarmContext:
    """Operating data of the bearing of an alarm, for the notification message about the alarm.

    Parameters
    ----------
    uncertainty
        Standard uncertainty of the alarm's value; None if unknown, and for films.
    state
        Name of the operating state; None if unknown.
    condition
        Label, value, unit and uncertainty of each quantity of `CONDITION` by name, as JSON object;
        for films also the stiffness and its deviation from the baseline in the newest reading.
    """

    uncertainty: float | None = None
    state: str | None = None
    condition: Mapping[str, Message] = field(default_factory=dict)


FindContext = Callable[[AlarmIdentity], AlarmContext]

NewestFilm = Callable[[str, str], FilmNews | None]
"""Function that returns the newest film verdict for a unit id and a bearing id."""


NewestResult = Callable[[str, str], Assessment | None]
"""Function that returns the newest result for a unit id and a bearing id."""


class LiveContext:
    """Callable that returns the context of an alarm from the newest monitoring results."""

    def __init__(self, newest: NewestResult) -> None:
        self._newest_result = newest
        self._newest_film: NewestFilm = lambda unit, bearing: None  # noqa: ARG005

    def watch_films(self, newest: NewestFilm) -> None:
        """Set the function that returns film verdicts; called when film monitoring starts."""
        self._newest_film = newest

    def __call__(self, identity: AlarmIdentity) -> AlarmContext:
        """Return the context of an alarm; empty if its bearing or part has no assessment."""
        assessment = self._newest_result(identity.unit, identity.subject)
        if assessment is None:
            return AlarmContext()
        condition = assessment.condition
        return AlarmContext(
            uncertainty=self._uncertainty(identity, assessment),
            state=condition.state.name.lower() if condition else None,
            condition=self._film(identity)
            | {
                name: _fact(quantity.label, reading.value, quantity.unit, reading.u_random)
                for name, quantity in CONDITION.items()
                if (reading := assessment.readings[name]).value is not None
            },
        )

    def _film(self, identity: AlarmIdentity) -> dict[str, Message]:
        """Return value, expected value and deviation of the quantity that changed most."""
        is_film = identity.kind == FILM_STIFFNESS
        news = self._newest_film(identity.unit, identity.subject) if is_film else None
        if news is None:
            return {}
        found = news.findings[news.worst]
        quantity = QUANTITIES[found.quantity]
        if found.deviation is None or found.deviation_std is None:
            return {}
        ln = getattr(news.reading.values[quantity.row], quantity.value)
        std = math.exp(found.deviation) * 100.0 * found.deviation_std
        key, label, scale, unit = FILM_FACTS[quantity.value]
        return {
            key: _fact(label, math.exp(ln) * scale, unit),
            "expected": _fact("Expected", math.exp(ln - found.deviation) * scale, unit),
            "deviation": _fact("Change now", percent_of(found.deviation), "%", std),
        }

    def _uncertainty(self, identity: AlarmIdentity, assessment: Assessment) -> float | None:
        kind = ALARM_KINDS.get(identity.kind)
        measured = assessment.readings.get(kind.reading or "") if kind else None
        return measured.u_random if measured else None


class Composer:
    """Factory of the notification messages of one plant.

    Parameters
    ----------
    url
        URL of the dashboard; None omits links.
    unit_names
        Displayed names of the units by id.
    context
        Function that returns the context of an alarm.
    new_id
        Function that returns a unique message id.
    """

    def __init__(
        self,
        plant: str,
        url: str | None,
        unit_names: Mapping[str, str],
        context: FindContext,
        new_id: Callable[[], str] = lambda: str(uuid4()),
    ) -> None:
        self._plant, self._unit_names = plant, unit_names
        self._url = None if url is None else f"{url.rstrip('/')}/{ALARMS_PAGE}"
        self._context, self._new_id = context, new_id

    def alarm(self, alarm: Alarm, event: AlarmEvent, is_active: bool, now_ns: int) -> Message:
        """Return the message about an event of an alarm, written at `now_ns`, ns since 1970 UTC.

        `alarm` is the alarm after the event, and `is_active` whether receivers regard it as active.
        """
        identity, context = event.identity, self._context(event.identity)
        return {
            **self._head("alarm", now_ns),
            "alarm": identity.id,
            "unit": identity.unit,
            "subject": identity.subject,
            "kind": identity.kind,
            "directions": event.directions,
            "number": event.number,
            "change": event.change.value,
            "priority": None if event.level is None else event.level.name.lower(),
            "is_active": is_active,
            "state": event.state_after.value,
            "occurrence": event.occurrence,
            "time": rfc3339(event.time_ns),
            "actor": event.actor,
            "reason": str(event.reason),
            "raised": None if alarm.raised_ns is None else rfc3339(alarm.raised_ns),
            "value": _finite(event.value),
            "uncertainty": _finite(context.uncertainty),
            "limit": _finite(event.limit),
            "value_unit": value_unit(identity.kind),
            "operating_state": context.state,
            "condition": dict(context.condition),
            "unit_name": self._unit_names.get(identity.unit),
        }

    def test(self, now_ns: int) -> Message:
        """Return a test message, written at the time `now_ns`, ns since 1970 UTC."""
        return self._head("test", now_ns)

    def _head(self, type_: str, now_ns: int) -> Message:
        return {
            "format": FORMAT,
            "id": self._new_id(),
            "type": type_,
            "plant": self._plant,
            "written": rfc3339(now_ns),
            "url": self._url,
        }


def dumps(message: Message) -> str:
    """Return a message as compact JSON text, in the form that is signed and sent."""
    return json.dumps(message, ensure_ascii=False, allow_nan=False, separators=(",", ":"))


def loads(body: str) -> Message:
    """Return the message that `dumps` serialized. Raises `ValueError` if the text is not JSON."""
    message: Message = json.loads(body)
    return message


def _fact(label: str, value: float, unit: str, uncertainty: float | None = None) -> Message:
    return {
        "label": label,
        "value": _finite(value),
        "unit": unit,
        "uncertainty": _finite(uncertainty),
    }


def _finite(number: float | None) -> float | None:
    """Return `number` if it is finite, otherwise None: JSON has no infinity and NaN."""
    return number if number is not None and math.isfinite(number) else None
