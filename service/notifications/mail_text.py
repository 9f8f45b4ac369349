"""An alarm in the words of a mail: what, where, since when, by how much, under which condition."""

import math
from collections.abc import Iterator

from service.notifications.message import Message
from service.notifications.network import printable
from service.settings.alarm_kinds import kind_words

CHANGES = {"escalated": "rose to danger", "eased": "eased to alert"}

WHOLE_UNIT = ("device", "link")

NOT_A_SYSTEM_OF_PROTECTION = (
    "padwatch is a condition-monitoring service and no protection system: this mail informs."
)


def subject(message: Message) -> str:
    """One line, fit for a header whatever the plant and its parts are called."""
    if message["type"] == "test":
        return printable(f"[padwatch] {message['plant']}: test message")
    priority = (message["priority"] or "").upper() if message["is_active"] else "over"
    words = f"{_place(message)} {kind_words(message['kind'])} {change_words(message)}"
    return printable(f"[padwatch] {message['plant']}: {priority}, {words}")


def text(message: Message) -> str:
    """The whole mail."""
    lines = _test(message) if message["type"] == "test" else _alarm(message)
    return "\n".join(lines) + "\n"


def change_words(message: Message) -> str:
    """What has happened to the alarm."""
    change: str = message["change"]
    return CHANGES.get(change, change.replace("_", " "))


def value_words(message: Message) -> str | None:
    """The value with its uncertainty, and the limit; None where there is no number."""
    value, limit, std = message["value"], message["limit"], message["uncertainty"]
    if value is None:
        return None
    if message["value_is"] == "ln_change":
        return _change(value, limit, std)
    unit = message["value_unit"] or ""
    spread = "" if std is None else f" ± {2 * std:.2g} (95 %)"
    passed = "" if limit is None else f"; limit {limit:g} {unit}"
    return f"{value:.4g}{spread} {unit}{passed}"


def _change(value: float, limit: float | None, std: float | None) -> str:
    """A change of a stiffness in ln, in percent of the baseline."""
    percent = 100.0 * math.expm1(value)
    spread = "" if std is None else f" ± {2 * 100.0 * std * math.exp(value):.1f} (95 %)"
    edge = None if limit is None else 100.0 * math.expm1(math.copysign(limit, value))
    passed = "" if edge is None else f"; limit {edge:+.1f} %"
    return f"{percent:+.1f}{spread} % against the baseline at the same condition{passed}"


def _alarm(message: Message) -> Iterator[str]:
    rows = [
        ("What", f"{kind_words(message['kind'])}: {change_words(message)}"),
        ("Priority", message["priority"]),
        ("Where", f"{message['plant']}, {_place(message)}{_unit_name(message)}"),
        ("When", message["time"]),
        ("Since", message["raised"]),
        ("Value", value_words(message)),
        ("Reason", "" if message["reason"] == "ok" else message["reason"].replace("_", " ")),
        ("By", message["actor"]),
        ("State", message["state"].replace("_", " ")),
        ("Operation", (message["operating_state"] or "").replace("_", " ")),
    ]
    for name, found in rows:
        if found:
            yield f"{name + ':':<11}{printable(str(found), 1000)}"
    for fact in message["condition"].values():
        spread = "" if fact["uncertainty"] is None else f" ± {2 * fact['uncertainty']:.2g} (95 %)"
        unit = "" if fact["unit"] == "1" else f" {fact['unit']}"
        yield f"{fact['label'] + ':':<20} {fact['value']:.4g}{spread}{unit}"
    yield from ("", *_foot(message))


def _test(message: Message) -> Iterator[str]:
    yield f"This is a test message of padwatch at {printable(message['plant'])}."
    yield "Alarms of this plant would arrive here."
    yield from ("", *_foot(message))


def _foot(message: Message) -> Iterator[str]:
    if message["url"]:
        yield f"Dashboard: {message['url']}"
    yield f"Event: {message['id']}"
    yield NOT_A_SYSTEM_OF_PROTECTION


def _place(message: Message) -> str:
    about_part = message["subject"] not in WHOLE_UNIT
    return f"{message['unit']} {message['subject']}" if about_part else str(message["unit"])


def _unit_name(message: Message) -> str:
    return f" ({message['unit_name']})" if message["unit_name"] else ""
