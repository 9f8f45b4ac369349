"""A mark beside a database that is none yet."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from service.store.highwater.file import MarkFile
from service.store.highwater.mark import Mark

MARK = Mark("5f" * 16, "host", 150, "c0ffee", 1_767_225_600_000_000_000)


@pytest.fixture
def mark() -> Callable[..., Mark]:
    """Builds marks."""
    return lambda **changes: replace(MARK, **changes)


@pytest.fixture
def file(tmp_path: Path) -> MarkFile:
    """A mark on the disk."""
    made = MarkFile(tmp_path / "padwatch.high-water-mark")
    made.replace(MARK)
    return made
