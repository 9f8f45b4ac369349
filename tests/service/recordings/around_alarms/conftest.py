"""Where captures are written."""

from pathlib import Path

import pytest


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Their folder."""
    return tmp_path / "captures"
