"""The service with one bug in it: ``python -m harness.planted run FILE --port 0``.

The environment variable PLANTED names the bug; it is planted as each process starts, measuring and
serving, and the product knows nothing of it. Among them is a host whose wall clock is wrong.
"""

import asyncio
import os
import runpy
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from acquisition.clock import SystemClock
from core.alarms.alarm import AlarmNews
from core.monitor.assessment import Assessment
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from core.samples.ring import Ring
from core.units import NS_PER_S
from harness.open_program import main
from service.live.current_state import LiveUnits
from service.measuring.alarm_engine import AlarmEngine
from service.measuring.recorder import Findings, Recorder
from service.recordings import continuous_recorder as tape
from service.recordings import continuous_recorder as unit_tape
from service.recordings import segment as joining
from service.recordings.segment import Segment
from service.runtime import child
from service.store import store as sql_store

SLOW_S = 1.5
"""How long a promise that is given too early is not kept yet."""


def alarms_forgotten_at_start() -> None:
    """Begin with all alarms normal."""
    AlarmEngine.restore = lambda self, *_: None  # type: ignore[method-assign]  # noqa: ARG005


def outage_not_recorded() -> None:
    """Go on after a stop as if nothing was missing."""
    UnitMonitor.go_on = lambda self, reach: None  # type: ignore[method-assign]  # noqa: ARG005


def gap_not_recorded() -> None:
    """Drop the gaps that are found while running."""
    UnitMonitor.drain_gaps = lambda self: []  # type: ignore[method-assign]  # noqa: ARG005


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
    LiveUnits._why_not_current = lambda self, unit, age_s: None  # type: ignore[method-assign]  # noqa: ARG005


def promised_before_commit() -> None:
    """Answer operators before what they did is on the disk."""
    append = sql_store.Store.append

    def late(self: Any, *args: Any, **options: Any) -> None:
        time.sleep(SLOW_S)
        append(self, *args, **options)

    async def at_once(self: Recorder) -> None:  # noqa: ARG001
        await asyncio.sleep(0)

    sql_store.Store.append = late  # type: ignore[method-assign]
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
    append, number = sql_store.Store.append, [0]

    def rounded(self: Any, assessments: Sequence[Assessment], *args: Any, **options: Any) -> None:
        number[0] += 1
        if number[0] % 5 == 0:
            for assessment in assessments:
                reading = assessment.readings["gap_x_um"]
                if reading.value is not None:
                    object.__setattr__(reading, "value", reading.value * (1.0 + 1e-12))
        append(self, assessments, *args, **options)

    sql_store.Store.append = rounded  # type: ignore[method-assign]


def letter_forgotten() -> None:
    """Queue nothing of every second event that receivers are to be told of."""
    insert, number = sql_store.insert_alarms, [0]

    def forgetful(writer: Any, alarms: Sequence[AlarmNews], add: Any, address: Any) -> None:
        def some(alarm: Any, event: Any) -> Any:
            number[0] += 1
            return address(alarm, event) if number[0] % 2 else ()

        insert(writer, alarms, add, some)

    sql_store.insert_alarms = forgetful


def promised_before_it_is_synced() -> None:
    """Count samples as recorded as soon as they are in memory."""
    write = Segment.write

    def counted(self: Segment, block: SampleBlock, now_s: float) -> None:
        write(self, block, now_s)
        TAPES[-1].n_written += block.n_samples

    def never_again(self: Segment) -> int:
        finish(self)
        return 0

    finish = Segment.finish_part
    Segment.write = counted  # type: ignore[method-assign]
    Segment.finish_part = never_again  # type: ignore[method-assign]
    made = unit_tape.UnitRecorder.__init__

    def noted(self: Any, *how: Any, **more: Any) -> None:
        made(self, *how, **more)
        TAPES.append(self)

    unit_tape.UnitRecorder.__init__ = noted  # type: ignore[method-assign]


def parts_thrown_away_at_start() -> None:
    """Take what a crash has left in parts for rubbish."""

    def cleared(root: Path, units: Any) -> list[Path]:
        for folder in joining.unjoined(root, units):
            joining._remove_parts(joining.parts_folder(folder))
        return []

    tape.unjoined = cleared


def hole_of_the_outage_not_told() -> None:
    """Begin after a restart as if nothing was missing."""
    tape.last_end = lambda root, unit: None  # noqa: ARG005


def part_joined_twice() -> None:
    """Leave the first part in its place when a stretch is joined, and let it be joined again."""
    write = joining._write

    def doubled(folder: Path, parts: Any) -> None:
        write(folder, parts)
        write(folder.with_name(f"{folder.name}-2"), parts[:1])

    joining._write = doubled


def sample_altered() -> None:
    """Write one sample otherwise than it came."""
    write = Segment.write

    def altered(self: Segment, block: SampleBlock, now_s: float) -> None:
        counts = block.counts.copy()
        counts[3, 0] = counts[3, 1]
        counts[4, 0] = counts[4, 1]
        write(self, replace(block, counts=counts), now_s)

    Segment.write = altered  # type: ignore[method-assign]


def wrong_wall_clock() -> None:
    """Step the host's wall clock by the seconds in the file WALL_CLOCK, and again on SIGUSR1."""
    path, wrong_ns = Path(os.environ["WALL_CLOCK"]), [0]

    def read(*_: object) -> None:
        wrong_ns[0] = round(float(path.read_text(encoding="ascii")) * NS_PER_S)

    read()
    signal.signal(signal.SIGUSR1, read)
    SystemClock.now_ns = lambda self: time.time_ns() + wrong_ns[0]  # type: ignore[method-assign]  # noqa: ARG005


TAPES: list[unit_tape.UnitRecorder] = []

if __name__ == "__main__":
    globals()[os.environ["PLANTED"]]()
    if sys.argv[1:2] == ["run"]:
        child.PROGRAM = "harness.planted"
    if sys.argv[1].isdecimal():  # as a serving process, which gets the number of its socket
        runpy.run_module("service.app.serving_process", run_name="__main__")
    else:
        main()
