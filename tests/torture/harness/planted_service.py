"""The service with one bug in it: ``python -m harness.planted_service run FILE --port 0``.

The bug is named by the environment variable PLANTED; it is put in as the process starts, and the
product knows nothing of it.
"""

import asyncio
import os
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from core.alarms.event import AlarmNews
from core.assessment import Assessment
from core.monitored_unit import MonitoredUnit
from core.ring import Ring
from service.alarms.engine import AlarmEngine
from service.cli.main import main
from service.live import LiveView
from service.recorder import Findings, Recorder
from service.store import sql_store

SLOW_S = 1.5
"""How long a promise that is given too early is not kept yet."""


def alarms_forgotten_at_start() -> None:
    """Begin with all alarms normal."""
    AlarmEngine.restore = lambda self, *_: None  # type: ignore[method-assign]  # noqa: ARG005


def outage_not_recorded() -> None:
    """Go on after a stop as if nothing was missing."""
    MonitoredUnit.go_on = lambda self, reach: None  # type: ignore[method-assign]  # noqa: ARG005


def gap_not_recorded() -> None:
    """Drop the gaps that are found while running."""
    MonitoredUnit.drain_gaps = lambda self: []  # type: ignore[method-assign]  # noqa: ARG005


def gap_closed_up() -> None:
    """Join samples behind a gap to those before it."""
    write, shift = Ring.write, {}

    def joined(self: Ring, block: Any) -> Any:
        moved = shift.get(id(self), 0)
        if self.epoch is not None and block.first_index - moved > self.stop_index:
            moved = shift[id(self)] = block.first_index - self.stop_index
        part = block.from_sample(0)
        object.__setattr__(part, "first_index", block.first_index - moved)
        return write(self, part)

    Ring.write = joined  # type: ignore[method-assign]


def stale_shown_as_current() -> None:
    """Show the newest result for as long as there is none newer."""
    LiveView._why_not_current = lambda self, unit, age_s: None  # type: ignore[method-assign]  # noqa: ARG005


def promised_before_commit() -> None:
    """Answer operators before what they did is on the disk."""
    append = sql_store.SqlStore.append

    def late(self: Any, *args: Any, **options: Any) -> None:
        time.sleep(SLOW_S)
        append(self, *args, **options)

    async def at_once(self: Recorder) -> None:  # noqa: ARG001
        await asyncio.sleep(0)

    sql_store.SqlStore.append = late  # type: ignore[method-assign]
    Recorder.stored = at_once  # type: ignore[method-assign]


def finding_dropped() -> None:
    """Lose every seventh finding on its way to the store."""
    put, number = Recorder.put, [0]

    def forgetful(self: Recorder, findings: Findings) -> None:
        number[0] += bool(findings.assessments)
        if not findings.assessments or number[0] % 7:
            put(self, findings)

    Recorder.put = forgetful  # type: ignore[method-assign]


def value_altered() -> None:
    """Store a number otherwise than it was found, now and then, in its last bits."""
    append, number = sql_store.SqlStore.append, [0]

    def rounded(self: Any, assessments: Sequence[Assessment], *args: Any, **options: Any) -> None:
        number[0] += 1
        if number[0] % 5 == 0:
            for assessment in assessments:
                reading = assessment.readings["gap_x_um"]
                if reading.value is not None:
                    object.__setattr__(reading, "value", reading.value * (1.0 + 1e-12))
        append(self, assessments, *args, **options)

    sql_store.SqlStore.append = rounded  # type: ignore[method-assign]


def letter_forgotten() -> None:
    """Queue nothing of every second event that receivers are to be told of."""
    insert, number = sql_store.insert_alarms, [0]

    def forgetful(writer: Any, alarms: Sequence[AlarmNews], add: Any, address: Any) -> None:
        def some(alarm: Any, event: Any) -> Any:
            number[0] += 1
            return address(alarm, event) if number[0] % 2 else ()

        insert(writer, alarms, add, some)

    sql_store.insert_alarms = forgetful


BUGS: Mapping[str, Callable[[], None]] = {
    bug.__name__: bug
    for bug in (
        alarms_forgotten_at_start,
        outage_not_recorded,
        gap_not_recorded,
        gap_closed_up,
        stale_shown_as_current,
        promised_before_commit,
        finding_dropped,
        value_altered,
        letter_forgotten,
    )
}


if __name__ == "__main__":
    BUGS[os.environ["PLANTED"]]()
    main()
