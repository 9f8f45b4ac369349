"""The service with a bug in its recordings: ``python -m harness.planted_recording run FILE``.

The bug is named by the environment variable PLANTED; the product knows nothing of it.
"""

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from core.blocks import SampleBlock
from service.cli.main import main
from service.continuous import joining, tape, unit_tape
from service.continuous.stretch import Stretch


def promised_before_it_is_synced() -> None:
    """Count samples as recorded as soon as they are in memory."""
    write = Stretch.write

    def counted(self: Stretch, block: SampleBlock, now_s: float) -> None:
        write(self, block, now_s)
        TAPES[-1].n_written += block.n_samples

    def never_again(self: Stretch) -> int:
        finish(self)
        return 0

    finish = Stretch.finish_part
    Stretch.write = counted  # type: ignore[method-assign]
    Stretch.finish_part = never_again  # type: ignore[method-assign]
    made = unit_tape.UnitTape.__init__

    def noted(self: Any, *how: Any, **more: Any) -> None:
        made(self, *how, **more)
        TAPES.append(self)

    unit_tape.UnitTape.__init__ = noted  # type: ignore[method-assign]


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
    write = Stretch.write

    def altered(self: Stretch, block: SampleBlock, now_s: float) -> None:
        samples = block.samples.copy()
        samples[3, 0] = samples[3, 1]
        samples[4, 0] = samples[4, 1]
        write(self, replace(block, samples=samples), now_s)

    Stretch.write = altered  # type: ignore[method-assign]


TAPES: list[unit_tape.UnitTape] = []
BUGS: dict[str, Callable[[], None]] = {
    bug.__name__: bug
    for bug in (
        promised_before_it_is_synced,
        parts_thrown_away_at_start,
        hole_of_the_outage_not_told,
        part_joined_twice,
        sample_altered,
    )
}

if __name__ == "__main__":
    BUGS[os.environ["PLANTED"]]()
    main()
