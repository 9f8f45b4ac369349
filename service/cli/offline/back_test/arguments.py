"""What people write on the command line, into values."""

import re
from datetime import UTC, datetime, timedelta

from service.cli.offline.back_test.periods import MachineEvent
from service.cli.offline.back_test.reading import IDENTIFIER

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_EVENT = re.compile(
    r"(?P<unit>[^\s/]+)(?:/(?P<bearing>[^\s/]+))?\s+(?P<time>\S+)(?:\s+(?P<text>.*))?"
)
MAX_TEXT = 200


def time_ns_of(text: str) -> int:
    """Nanoseconds since 1970.

    Raises
    ------
    ValueError
        If it is no time of ISO 8601, or has no offset from UTC: local time would be a guess.
    """
    try:
        moment = datetime.fromisoformat(text)
    except ValueError as error:
        raise ValueError(f"{text!r:.60} is not a time like 2026-03-01T08:00:00Z") from error
    if moment.tzinfo is None:
        raise ValueError(f"{text!r:.60} needs an offset from UTC, such as a trailing Z")
    return (moment - _EPOCH) // timedelta(microseconds=1) * 1000


def event_of(text: str) -> MachineEvent:
    """Read an event, written ``UNIT[/BEARING] TIME [WORDS]``.

    Raises
    ------
    ValueError
        If it is written otherwise.
    """
    found = _EVENT.fullmatch(text.strip())
    names = [found["unit"], found["bearing"]] if found else []
    if not found or not all(name is None or IDENTIFIER.fullmatch(name) for name in names):
        example = "'U1 2026-03-01T08:00:00Z overhaul' or 'U1/UJB 2026-03-01T08:00:00Z new pads'"
        raise ValueError(f"{text!r:.60} is not an event like {example}")
    words = (found["text"] or "machine event")[:MAX_TEXT]
    return MachineEvent(found["unit"], found["bearing"], time_ns_of(found["time"]), words)
