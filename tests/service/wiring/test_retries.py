"""How often a device that is away is called."""

from pathlib import Path

import pytest

from service.settings.loading import load_plant_file
from service.settings.modbus_sources import ModbusFifoSettings
from service.wiring.sources import retry_s

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"


RING = load_plant_file(DEMO).unit[0].source
QUEUE = ModbusFifoSettings(kind="modbus_fifo", host="127.0.0.1", addresses=[1000])
"""A queue that is emptied all the time is not called all the time."""


@pytest.mark.parametrize(
    ("source", "expected_s"),
    [
        *((RING.model_copy(update={"poll_period_s": s}), s) for s in (0.05, 0.25, 1.0)),
        (QUEUE, 0.25),
    ],
)
def test_a_device_is_called_once_a_poll_period(source, expected_s) -> None:
    unit = load_plant_file(DEMO).unit[0]
    assert retry_s(unit.model_copy(update={"source": source})) == expected_s
