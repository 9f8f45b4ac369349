"""Databases with four hours of results in them."""

import pytest
from rigs.assessments import assessment
from rigs.rolled_trends import plain_and_gathered
from rigs.varied_results import life

from core.monitor.assessment import Assessment


@pytest.fixture(scope="session")
def results() -> list[Assessment]:
    """Results of four hours."""
    return life(assessment)


@pytest.fixture(scope="session")
def files(results: list[Assessment]) -> dict[str, bytes]:
    """Databases that hold them, one of them gathered."""
    return plain_and_gathered(results)
