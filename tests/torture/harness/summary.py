"""What `make torture` does and says: a table of figures.

A test records a figure by its fixture ``torture``: a row of the table and what was found.
"""

import os
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import pytest

from harness.watch import PERIOD_S

FIGURE = "figure"

N_SHORT = 25
"""By how much the short torture of every test run is less than the whole one."""


@dataclass(frozen=True)
class Torture:
    """How much a test does: as in the whole torture, or as in every run of all tests.

    Parameters
    ----------
    seed
        Of everything that is random.
    figure
        Adds a row to the table at the end.
    """

    seed: int
    is_whole: bool
    figure: Callable[[str], None]

    def times(self, number: int) -> int:
        """Number of repetitions, of the number that the whole torture takes."""
        return number if self.is_whole else max(1, number // N_SHORT)

    @property
    def period_s(self) -> float:
        """Time between two questions of a client, which cost most of the short torture."""
        return PERIOD_S if self.is_whole else 3.0 * PERIOD_S


def lines(stats: Mapping[str, Sequence[pytest.TestReport]], seed: int) -> list[str]:
    """The table."""
    figures = [
        str(row)
        for reports in stats.values()
        for report in reports
        if isinstance(report, pytest.TestReport)
        for name, row in report.user_properties
        if name == FIGURE
    ]
    failed = [report for kind in ("failed", "error") for report in stats.get(kind, ())]
    return [
        f"seed {seed}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC, {os.cpu_count()} cores,"
        f" {platform.system()}, Python {platform.python_version()}",
        *dict.fromkeys(figures),
        f"tests failed: {len(failed)}",
    ]


def write(path: Path, found: Sequence[str]) -> None:
    """Keep the table."""
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(found) + "\n", encoding="utf-8")
