"""How often a device that is away is called."""

from pathlib import Path

import pytest

from service.settings.loading import load_plant_file
from service.settings.modbus_sources import ModbusFifoSettings
from service.wiring.sources import retry_s

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"


@pytest.mark.parametrize(("poll_period_s", "expected_s"), [(0.05, 0.05), (0.25, 0.25), (1.0, 1.0)])
def test_a_device_is_called_once_a_poll_period(poll_period_s, expected_s) -> None:
    unit = load_plant_file(DEMO).unit[0]
    source = unit.source.model_copy(update={"poll_period_s": poll_period_s})
    assert retry_s(unit.model_copy(update={"source": source})) == expected_s


def test_a_queue_that_is_emptied_all_the_time_is_not_called_all_the_time() -> None:
    unit = load_plant_file(DEMO).unit[0]
    source = ModbusFifoSettings(kind="modbus_fifo", host="127.0.0.1", addresses=[1000])
    assert source.poll_period_s < 0.01
    assert retry_s(unit.model_copy(update={"source": source})) == 0.25
