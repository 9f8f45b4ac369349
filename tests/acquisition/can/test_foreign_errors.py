"""What a CAN library raises is renamed, and says what has failed."""

import inspect
import socket

import can
import cantools.database.errors
import pytest
import serial
from rigs.fake_bus import VIRTUAL, can_threads, send_block

from acquisition.can.bus import open_bus
from acquisition.can.settings import CanLinkSettings
from acquisition.errors import AcquisitionError, ConfigError, LinkError

FOREIGN = [
    *(
        kind
        for module in (can.exceptions, serial, cantools.database.errors)
        for _, kind in inspect.getmembers(module, inspect.isclass)
        if issubclass(kind, Exception) and kind.__module__ != "builtins"
    ),
    OSError,
    TimeoutError,
    ConnectionResetError,
    BrokenPipeError,
    socket.gaierror,
    EOFError,
    ValueError,
]


WORDS = "as seen in the field|not open"


def raised(kind: type[Exception]) -> Exception:
    """An exception of a kind, some of which are particular about their arguments."""
    if kind is cantools.database.errors.UnsupportedDatabaseFormatError:
        n_formats = len(inspect.signature(kind).parameters)
        return kind(*[ValueError("as seen in the field")] * n_formats)
    return kind() if kind is serial.PortNotOpenError else kind("as seen in the field")


@pytest.mark.parametrize("kind", FOREIGN, ids=lambda kind: kind.__name__)
async def test_what_a_library_raises_on_opening_is_renamed(kind, shape, source_of):
    def fails(*_):
        raise raised(kind)

    source = source_of(shape, VIRTUAL, opener=fails)
    with pytest.raises(AcquisitionError, match=WORDS):
        async with source.connect():
            pass
    assert can_threads() == []


@pytest.mark.parametrize("kind", FOREIGN, ids=lambda kind: kind.__name__)
async def test_what_a_library_raises_on_reading_is_renamed(kind, fake_bus_source, fake_bus):
    async with fake_bus_source.connect() as stream:
        fake_bus.failure = raised(kind)
        with pytest.raises(AcquisitionError, match=f"{WORDS}|cannot be read"):
            await anext(stream)
    assert fake_bus.n_shutdowns == 1
    assert can_threads() == []


@pytest.mark.parametrize("kind", [can.CanOperationError, serial.SerialException, OSError])
async def test_what_a_library_raises_on_closing_is_harmless(
    kind, fake_bus_source, fake_bus, device
):
    fake_bus.on_shutdown = kind("as seen in the field")
    async with fake_bus_source.connect() as stream:
        send_block(device, fake_bus)
        await anext(stream)
    assert can_threads() == []


async def test_a_bug_in_a_driver_is_not_hidden(fake_bus_source, fake_bus):
    async with fake_bus_source.connect() as stream:
        fake_bus.failure = ZeroDivisionError("a bug")
        with pytest.raises(ZeroDivisionError, match="a bug"):
            await anext(stream)
    assert can_threads() == []


@pytest.mark.parametrize(
    ("link", "kind", "words"),
    [
        ({"interface": "socketcan", "channel": "can0"}, AcquisitionError, "socketcan can0: "),
        ({"interface": "nosuch", "channel": "x"}, ConfigError, "nosuch"),
        (
            {"interface": "socketcan", "channel": "can0", "options": {"nosuch": 1}},
            ConfigError,
            "can0",
        ),
        ({"interface": "kvaser", "channel": "0"}, ConfigError, "kvaser"),
        ({"interface": "pcan", "channel": "PCAN_USBBUS1"}, ConfigError, "library"),
        ({"interface": "slcan", "channel": "/dev/ttyNONE"}, LinkError, "No such file"),
        ({"interface": "slcan", "channel": ""}, ConfigError, "serial port"),
        ({"interface": "slcan", "channel": "socket://127.0.0.1"}, AcquisitionError, "port"),
        (
            {"interface": "slcan", "channel": "/dev/null", "bitrate": 7},
            ConfigError,
            "bitrate is 7, allowed",
        ),
    ],
)
def test_a_bus_that_cannot_be_opened_says_why(link, kind, words):
    with pytest.raises(kind, match=words):
        open_bus(CanLinkSettings(**link), [1])
