"""What `make torture` does and says: a table of figures, and which planted bugs were caught.

A test records a figure by its fixture ``torture``: a row of the table and what was found. A test
that plants a bug is marked ``planted`` with the bug's name; it passes if the harness catches it.
"""

import os
import platform
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import pytest
from _pytest.mark import ParameterSet

from harness.watch import PERIOD_S

FIGURE, PLANTED = "figure", "planted"

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


def planted(bug: str, *values: object, mark: pytest.MarkDecorator) -> ParameterSet:
    """Parameters of a test that plants a bug, with the mark of its tier."""
    return pytest.param(bug, *values, marks=(pytest.mark.planted(bug), mark), id=bug)


def note_planted(items: Iterable[pytest.Item]) -> None:
    """Let the reports of tests that plant a bug name it."""
    for item in items:
        for marker in item.iter_markers(PLANTED):
            item.user_properties += [(PLANTED, name) for name in marker.args]


def properties(reports: Iterable[pytest.TestReport], kind: str) -> list[object]:
    """What tests have recorded of a kind, each once."""
    found = [value for report in reports for name, value in report.user_properties if name == kind]
    return list(dict.fromkeys(found))


def lines(stats: Mapping[str, Sequence[pytest.TestReport]], seed: int) -> list[str]:
    """The table, and the planted bugs."""
    everything = [
        report
        for reports in stats.values()
        for report in reports
        if isinstance(report, pytest.TestReport)
    ]
    passed = [report for report in stats.get("passed", ()) if report.when == "call"]
    planted, caught = properties(everything, PLANTED), properties(passed, PLANTED)
    failed = [report for kind in ("failed", "error") for report in stats.get(kind, ())]
    missed = [bug for bug in planted if bug not in caught]
    return [
        f"seed {seed}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC, {os.cpu_count()} cores,"
        f" {platform.system()}, Python {platform.python_version()}",
        *(str(row) for row in properties(everything, FIGURE)),
        f"planted bugs caught: {len(caught)} of {len(planted)}",
        *(f"  caught: {bug}" for bug in caught),
        *(f"  NOT CAUGHT: {bug}" for bug in missed),
        f"tests failed: {len(failed)}",
    ]


def write(path: Path, found: Sequence[str]) -> None:
    """Keep the table."""
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(found) + "\n", encoding="utf-8")
