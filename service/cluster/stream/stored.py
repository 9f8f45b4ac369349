"""Where units go on, by what is stored of them."""

from collections.abc import Iterable

import structlog

from service.cluster.stream.memory import read
from service.measuring.analyser import UnitMemory
from service.store.positions_port import StreamPosition

log = structlog.get_logger()


def memories_of(stored: Iterable[StreamPosition]) -> dict[str, UnitMemory]:
    """What is known of units, as far as it can be read."""
    found = {position.unit: read(position.memory) for position in stored}
    for unit, memory in found.items():
        if memory is None:
            log.error(
                "what was known of a unit is of another version: alarms begin anew", unit=unit
            )
    return {unit: memory for unit, memory in found.items() if memory is not None}


def usable(stored: StreamPosition | None, stream: str, newest: int) -> StreamPosition | None:
    """A stored position, if it is one on this stream as the stream is."""
    if stored is None:
        return None
    if stored.stream != stream:
        log.error("the stream was made anew: results go on with what is on it", unit=stored.unit)
        return None
    if stored.sequence > newest:
        log.error("the stream has lost what it had confirmed", unit=stored.unit)
        return None
    return stored
