"""Databases with nine hours of results in them."""

from pathlib import Path

import pytest
from rigs.assessments import assessment
from rigs.old_results import life
from rigs.rolled_trends import plain_and_gathered


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Where the database is of which results are deleted."""
    return tmp_path / "rolled.sqlite3"


@pytest.fixture(scope="session")
def files() -> dict[str, bytes]:
    """Databases with a life in them, one of them gathered."""
    return plain_and_gathered(life(assessment))
