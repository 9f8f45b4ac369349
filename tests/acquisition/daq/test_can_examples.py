"""The DBC files in deploy/ are those of the simulated DAQ of the demo plant."""

import itertools
import tomllib
from pathlib import Path

import pytest
from rigs.tiers import fast_and_long

from acquisition.daq.can_dbc import daq_dbc
from acquisition.daq.can_shape import CanShape, DaqSignal, dbc_name
from acquisition.errors import ConfigError

DEPLOY = Path(__file__).parents[3] / "deploy"
COUNTS = 32768


def demo_shape(**others) -> CanShape:
    unit = tomllib.loads((DEPLOY / "demo.toml").read_text(encoding="utf-8"))["unit"][0]
    return CanShape(
        channels=tuple(
            DaqSignal(c["id"], "V", c["full_scale_v"] / COUNTS) for c in unit["channel"]
        ),
        slow=tuple(DaqSignal(s["id"], s["unit"]) for s in unit["slow_channel"]),
        **others,
    )


@pytest.mark.parametrize(("name", "fd"), [("demo_classic.dbc", False), ("demo_fd.dbc", True)])
def test_an_example_is_what_the_simulated_daq_sends(name, fd):
    text = (DEPLOY / "can" / name).read_text(encoding="utf-8")
    assert text == daq_dbc(demo_shape(fd=fd))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"base_id": 0x7FF}, "base_id is 2047"),
        ({"base_id": -1}, "base_id is -1"),
        ({"channels": ()}, "0 channels"),
        ({"channels": tuple(DaqSignal(f"c{n}", "V") for n in range(33))}, "33 channels"),
    ],
)
def test_a_shape_that_does_not_fit_is_refused(wrong, words):
    with pytest.raises(ConfigError, match=words):
        CanShape(**{"channels": (DaqSignal("x", "V"),)} | wrong)


def test_an_id_becomes_a_name_that_dbc_allows():
    assert [dbc_name(i) for i in ("ujb.shaft-x", "1x", "µ")] == ["ujb_shaft_x", "_1x", "_"]


@pytest.mark.parametrize("numbers", fast_and_long((1, 4, 9, 31, 32), range(1, 33)))
@pytest.mark.parametrize("n_slow", [0, 1, 10, 11, 50])
@pytest.mark.parametrize(("fd", "floats"), [*itertools.product((False, True), repeat=2)])
def test_every_number_of_channels_fits(numbers, n_slow, fd, floats):
    slow = tuple(DaqSignal(f"s{n}", "MW") for n in range(n_slow))
    for n_channels in numbers:
        channels = tuple(DaqSignal(f"c{n}", "V") for n in range(n_channels))
        shape = CanShape(channels=channels, slow=slow, fd=fd, floats=floats)
        carried = [f.name for m in shape.messages for f in m.fields]
        for channel in shape.channels:
            names = list(shape.sample_names(channel.id))
            assert [name for name in carried if name in names] == names
        assert all(m.length <= (64 if fd else 8) for m in shape.messages)
