"""The monitor of a rack."""

from collections.abc import Callable
from functools import partial

import pytest
from rigs.racks import monitor_of

from core.machine.unit import Unit
from core.monitor.vector_monitor import VectorMonitor


@pytest.fixture
def rack(unit: Unit) -> Callable[..., VectorMonitor]:
    """Builds monitors of the unit, whose shaft channels count motion towards the probe."""
    return partial(monitor_of, unit)
