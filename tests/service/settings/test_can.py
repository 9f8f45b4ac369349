"""A unit of the plant file over CAN: its simulated DAQ and its source fit each other."""

from pathlib import Path

import numpy as np
import pytest

from acquisition.can.source import CanSource
from acquisition.simulated.devices.can_shape import daq_dbc
from service.measuring.simulated_sources import simulated_feed
from service.settings.adapter_values import can_daq_of, can_settings_of, can_shape_of
from service.settings.core_values import calibration_of
from service.settings.sources.can import CanSettings
from service.settings.transducers import FOLDER

DEPLOY = Path(__file__).parents[3] / "deploy"
PLACE = {"kind": "can", "interface": "slcan", "channel": "socket://127.0.0.1:0"}


def settings(**keys) -> CanSettings:
    return CanSettings.model_validate(PLACE | keys, context={FOLDER: DEPLOY / "can"})


@pytest.mark.parametrize("fd", [False, True], ids=["classic", "fd"])
async def test_a_simulated_unit_is_read_over_can_as_without_a_wire(fd, unit, stepped_clock):
    source = settings(profile="padwatch_int16", fd=fd)
    feed, same = (simulated_feed(unit, stepped_clock) for _ in range(2))
    async with can_daq_of(unit, source, feed, None, patient=False) as server:
        found = settings(profile="padwatch_int16", fd=fd, **server.endpoint)
        reader = CanSource(can_settings_of(unit, found), calibration_of(unit), stepped_clock)
        async with reader.connect() as stream:
            for _ in range(3):
                block = await anext(stream)
                raw = same.advance(block.n_samples)
                gains = [c.unit_per_count for c in calibration_of(unit).channels]
                expected = raw.counts.astype(np.float32) * np.float32(gains)[:, np.newaxis]
                np.testing.assert_array_equal(block.samples, expected)
                assert (block.epoch, block.first_index) == (raw.epoch, raw.first_index)
                assert block.side.slow[0, 0] == pytest.approx(raw.slow[0], rel=1e-7)


def test_the_example_dbc_is_that_of_the_demo_plant(unit):
    for name, fd in (("demo_classic.dbc", False), ("demo_fd.dbc", True)):
        shape = can_shape_of(unit, settings(profile="padwatch_int16", fd=fd))
        assert daq_dbc(shape) == (DEPLOY / "can" / name).read_text(encoding="utf-8")


def test_the_example_dbc_can_be_named_as_any_other(unit, stepped_clock):
    waves = {c.id: f"WAVE_{n // 3}.{c.id}" for n, c in enumerate(unit.channel)}
    source = settings(
        dbc="demo_classic.dbc",
        signals=waves,
        slow={s.id: f"SLOW_{n}.{s.id}" for n, s in enumerate(unit.slow_channel)},
        counters=[f"WAVE_{n}.counter" for n in range(4)],
    )
    source.check_channels([c.id for c in unit.channel], [s.id for s in unit.slow_channel])
    CanSource(can_settings_of(unit, source), calibration_of(unit), stepped_clock)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"profile": "padwatch_int16", "channel": "can0"}, "a simulated DAQ cannot use channel"),
        (
            {"profile": "padwatch_int16", "channel": "socket://127.0.0.1:x"},
            "a simulated DAQ cannot use channel",
        ),
        ({"dbc": "demo_classic.dbc", "signals": {"x": "A.b"}}, "the messages of a DBC file"),
    ],
)
def test_a_daq_that_cannot_be_simulated_is_refused(keys, said, unit, stepped_clock):
    feed = simulated_feed(unit, stepped_clock)
    with pytest.raises(LookupError, match=said):
        can_daq_of(unit, settings(**keys), feed, None, patient=False)
