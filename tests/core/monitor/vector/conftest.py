"""The monitor of a rack."""

from collections.abc import Callable
from functools import partial

import pytest
from rigs.racks import monitor_of

from core.machine.unit import Unit
from core.monitor.monitor import UnitMonitor


@pytest.fixture
def rack(unit: Unit) -> Callable[..., UnitMonitor]:
    """Builds monitors of the unit, whose shaft channels count motion towards the probe."""
    return partial(monitor_of, unit)
