"""The thread that listens: what ends it is told at once, and none is ever left behind."""

import asyncio
import inspect
import queue
import socket
import threading

import can
import cantools.database.errors
import numpy as np
import pytest
import serial

from acquisition.can.bus import open_bus
from acquisition.can.settings import CanLinkSettings
from acquisition.daq.can_bus import _message
from acquisition.daq.can_device import CanDevice
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
VIRTUAL = {"interface": "virtual", "channel": "a test's own bus"}


class FakeBus(can.BusABC):
    """A bus at whose other end a test stands."""

    def __init__(self) -> None:
        self.messages: queue.SimpleQueue = queue.SimpleQueue()
        self.failure: Exception | None = None
        self.on_shutdown: Exception | None = None
        self.n_shutdowns = 0
        self.can_state = can.BusState.ACTIVE
        super().__init__("fake")

    def _recv_internal(self, timeout):
        if self.failure is not None:
            raise self.failure
        try:
            message = self.messages.get(block=timeout != 0, timeout=timeout)
        except queue.Empty:
            return None, True
        if isinstance(message, Exception):
            raise message
        return message, True

    def send(self, msg, timeout=None):  # noqa: ARG002
        raise AssertionError("padwatch has sent a frame")

    @property
    def state(self):
        return self.can_state

    def shutdown(self) -> None:
        self.n_shutdowns += 1
        super().shutdown()
        if self.on_shutdown is not None:
            raise self.on_shutdown


def can_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("can ")]


def raised(kind: type[Exception]) -> Exception:
    """An exception of a kind, some of which are particular about their arguments."""
    if kind is cantools.database.errors.UnsupportedDatabaseFormatError:
        n_formats = len(inspect.signature(kind).parameters)
        return kind(*[ValueError("as seen in the field")] * n_formats)
    return kind() if kind is serial.PortNotOpenError else kind("as seen in the field")


@pytest.fixture
def bus() -> FakeBus:
    return FakeBus()


@pytest.fixture
def shape(shape_of):
    return shape_of()


@pytest.fixture
def device(shape, counting_feed):
    return CanDevice(counting_feed(n_channels=4), shape)


@pytest.fixture
def source(shape, bus, source_of):
    return source_of(shape, VIRTUAL, opener=lambda *_: bus, stale_after_s=60.0)


def send_block(device, bus) -> None:
    device.produce()
    for frame in device.next_frames():
        bus.messages.put(_message(frame))


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
async def test_what_a_library_raises_on_reading_is_renamed(kind, source, bus):
    async with source.connect() as stream:
        bus.failure = raised(kind)
        with pytest.raises(AcquisitionError, match=f"{WORDS}|cannot be read"):
            await anext(stream)
    assert bus.n_shutdowns == 1
    assert can_threads() == []


@pytest.mark.parametrize("kind", [can.CanOperationError, serial.SerialException, OSError])
async def test_what_a_library_raises_on_closing_is_harmless(kind, source, bus, device):
    bus.on_shutdown = kind("as seen in the field")
    async with source.connect() as stream:
        send_block(device, bus)
        await anext(stream)
    assert can_threads() == []


async def test_a_bug_in_a_driver_is_not_hidden(source, bus):
    async with source.connect() as stream:
        bus.failure = ZeroDivisionError("a bug")
        with pytest.raises(ZeroDivisionError, match="a bug"):
            await anext(stream)
    assert can_threads() == []


async def test_now_and_then_a_message_that_cannot_be_read_is_counted(source, bus, device):
    async with source.connect() as stream:
        send_block(device, bus)
        await anext(stream)
        bus.messages.put(ValueError("nonsense"))
        send_block(device, bus)
        bus.messages.put(ValueError("nonsense"))
        send_block(device, bus)
        assert (await anext(stream)).first_index == 50
        assert (await anext(stream)).first_index == 100
    assert source.refused_frames == {"malformed_line": 2}


def error_frame(bits: int, *data: int) -> can.Message:
    return can.Message(
        arbitration_id=bits,
        is_extended_id=False,
        is_error_frame=True,
        data=bytes(data).ljust(8, b"\0"),
    )


@pytest.mark.parametrize(
    ("frame", "words"),
    [
        (error_frame(0x40), "bus-off"),
        (error_frame(0x04, 0, 0x10), "error-passive"),
        (error_frame(0x04, 0, 0x20), "error-passive"),
        (error_frame(0x44, 0, 0x04), "bus-off"),
    ],
)
async def test_a_controller_that_leaves_the_bus_is_a_lost_link(frame, words, source, bus, device):
    async with source.connect() as stream:
        send_block(device, bus)
        bus.messages.put(frame)
        assert (await anext(stream)).first_index == 0
        with pytest.raises(LinkError, match=words):
            await anext(stream)


@pytest.mark.parametrize(
    "frame", [error_frame(0x04, 0, 0x04), error_frame(0x88), error_frame(0x100), error_frame(0x20)]
)
async def test_lesser_errors_and_a_restarted_controller_are_only_counted(
    frame, source, bus, device
):
    async with source.connect() as stream:
        bus.messages.put(frame)
        send_block(device, bus)
        await anext(stream)
    assert source.refused_frames == {"error_frame": 1}


async def test_an_overflow_in_the_controller_is_counted_as_such(source, bus, device):
    async with source.connect() as stream:
        bus.messages.put(error_frame(0x04, 0, 0x01))
        send_block(device, bus)
        await anext(stream)
    assert source.refused_frames == {"error_frame": 1, "queue_overflow": 1}


async def test_an_interface_that_says_it_is_in_error_is_a_lost_link(source, bus):
    async with source.connect() as stream:
        bus.can_state = can.BusState.ERROR
        with pytest.raises(LinkError, match="in error"):
            await anext(stream)


async def test_silence_is_a_lost_link_after_the_stale_time(shape, bus, source_of):
    source = source_of(shape, VIRTUAL, opener=lambda *_: bus, stale_after_s=0.2)
    async with source.connect() as stream:
        with pytest.raises(LinkError, match="no complete sample for 0"):
            await anext(stream)


async def test_a_source_that_is_cancelled_while_opening_leaves_no_thread(shape, bus, source_of):
    opening, go_on = threading.Event(), threading.Event()

    def slow(*_):
        opening.set()
        go_on.wait(5.0)
        return bus

    async def connect():
        async with source_of(shape, VIRTUAL, opener=slow).connect():
            pass

    task = asyncio.create_task(connect())
    while not opening.is_set():
        await asyncio.sleep(0.001)
    task.cancel()
    await asyncio.sleep(0)
    go_on.set()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert bus.n_shutdowns == 1
    assert can_threads() == []


async def test_twenty_reconnections_leave_nothing(source, bus, device):
    for n in range(20):
        async with source.connect() as stream:
            send_block(device, bus)
            assert (await anext(stream)).first_index == 50 * n
        bus._is_shutdown = False
    assert bus.n_shutdowns == 20
    assert can_threads() == []


async def test_frames_before_a_failure_are_delivered(source, bus, device):
    async with source.connect() as stream:
        send_block(device, bus)
        assert (await anext(stream)).first_index == 0
        send_block(device, bus)
        while bus.messages.qsize():
            await asyncio.sleep(0.001)
        bus.failure = can.CanOperationError("unplugged")
        assert (await anext(stream)).first_index == 50
        with pytest.raises(LinkError, match="unplugged"):
            await anext(stream)


async def test_a_device_whose_stamps_go_back_is_flagged(shape, bus, source, counting_feed):
    """C8: the index goes on, the stamp that does not fit is not used, and says so."""
    feed = counting_feed(n_channels=4)
    device = CanDevice(feed, shape)
    async with source.connect() as stream:
        for hours in (0, -2, 0, 0):
            feed._start_ns += hours * 3600 * 10**9
            send_block(device, bus)
            feed._start_ns -= hours * 3600 * 10**9
        blocks = [await anext(stream) for _ in range(4)]
    assert [block.stamp_fault for block in blocks] == [None, None, "stamp_regressed", None]
    assert len(np.unique(np.diff([block.start_ns for block in blocks]) // 10**6)) == 1


@pytest.mark.parametrize(
    ("link", "kind", "words"),
    [
        ({"interface": "socketcan", "channel": "can0"}, AcquisitionError, "socketcan can0: "),
        ({"interface": "nosuch", "channel": "x"}, ConfigError, "nosuch"),
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


def test_an_option_that_an_interface_does_not_know_is_a_config_error():
    link = CanLinkSettings(interface="socketcan", channel="can0", options={"nosuch": 1})
    with pytest.raises(ConfigError):
        open_bus(link, None)
