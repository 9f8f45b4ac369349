"""The thread that reads a bus: what ends it is reported at once, and no thread is left behind."""

import asyncio
import inspect
import socket
import threading

import can
import numpy as np
import pytest
import serial
from rigs.fake_bus import VIRTUAL, can_threads, send_block

from acquisition.can.bus import open_bus
from acquisition.can.settings import CanLinkSettings
from acquisition.clock import SystemClock
from acquisition.errors import AcquisitionError, ConfigError, LinkError
from acquisition.simulated.devices.can_device import CanDevice


class HeldClock(SystemClock):
    """Of a host on which nothing ran for a while."""

    held_s = 0.0

    def monotonic_s(self) -> float:
        return super().monotonic_s() + self.held_s


async def test_an_occasional_unreadable_message_is_counted(fake_bus_source, fake_bus, device):
    async with fake_bus_source.connect() as stream:
        send_block(device, fake_bus)
        await anext(stream)
        fake_bus.messages.put(ValueError("nonsense"))
        send_block(device, fake_bus)
        fake_bus.messages.put(ValueError("nonsense"))
        send_block(device, fake_bus)
        blocks = [await anext(stream)]
        while blocks[-1].stop_index < 150:
            blocks.append(await anext(stream))
    assert [block.first_index for block in blocks] == [50, *(b.stop_index for b in blocks[:-1])]
    assert blocks[-1].stop_index == 150
    assert fake_bus_source.refused_frames == {"malformed_line": 2}


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
async def test_a_controller_that_leaves_the_bus_is_a_lost_link(
    frame, words, fake_bus_source, fake_bus, device
):
    async with fake_bus_source.connect() as stream:
        send_block(device, fake_bus)
        fake_bus.messages.put(frame)
        assert (await anext(stream)).first_index == 0
        with pytest.raises(LinkError, match=words):
            await anext(stream)


@pytest.mark.parametrize(
    ("frame", "overflow"),
    [
        *((error_frame(bits), {}) for bits in (0x88, 0x100, 0x20)),
        (error_frame(0x04, 0, 0x04), {}),
        (error_frame(0x04, 0, 0x01), {"queue_overflow": 1}),
    ],
)
async def test_lesser_errors_and_a_restarted_controller_are_only_counted(
    frame, overflow, fake_bus_source, fake_bus, device
):
    async with fake_bus_source.connect() as stream:
        fake_bus.messages.put(frame)
        send_block(device, fake_bus)
        await anext(stream)
    assert fake_bus_source.refused_frames == {"error_frame": 1} | overflow


async def test_an_interface_that_says_it_is_in_error_is_a_lost_link(fake_bus_source, fake_bus):
    async with fake_bus_source.connect() as stream:
        fake_bus.can_state = can.BusState.ERROR
        with pytest.raises(LinkError, match="in an error state"):
            await anext(stream)


@pytest.mark.usefixtures("fake_bus")
async def test_silence_is_a_lost_link_after_the_stale_time(shape, source_of):
    source = source_of(shape, VIRTUAL, stale_after_s=0.2)
    async with source.connect() as stream:
        with pytest.raises(LinkError, match="no complete sample for 0"):
            await anext(stream)


async def test_a_host_that_stood_still_takes_its_own_silence_for_no_silence_of_the_bus(
    shape, fake_bus, source_of, device
):
    clock, settings = HeldClock(), {"stale_after_s": 1.0, "when_full": "wait"}
    source = source_of(shape, VIRTUAL, clock=clock, **settings)
    async with source.connect() as stream:
        send_block(device, fake_bus)
        await anext(stream)
        following = asyncio.ensure_future(anext(stream))
        await asyncio.sleep(0)
        clock.held_s = 60.0
        await asyncio.wait([following], timeout=0.5)
        assert not following.done()
        send_block(device, fake_bus)
        await following


async def test_a_source_cancelled_while_opening_leaves_no_thread(
    shape, fake_bus, source_of, monkeypatch
):
    opening, go_on = threading.Event(), threading.Event()

    def slow(*_, **__):
        opening.set()
        go_on.wait(5.0)
        return fake_bus

    monkeypatch.setattr("can.interfaces.virtual.VirtualBus", slow)

    async def connect():
        async with source_of(shape, VIRTUAL).connect():
            pass

    task = asyncio.create_task(connect())
    while not opening.is_set():
        await asyncio.sleep(0.001)
    task.cancel()
    await asyncio.sleep(0)
    go_on.set()
    with pytest.raises(asyncio.CancelledError):
        await task
    assert fake_bus.n_shutdowns == 1
    assert can_threads() == []


async def test_twenty_reconnections_leave_nothing(fake_bus_source, fake_bus, device):
    for n in range(20):
        async with fake_bus_source.connect() as stream:
            send_block(device, fake_bus)
            assert (await anext(stream)).first_index == 50 * n
        fake_bus._is_shutdown = False
    assert fake_bus.n_shutdowns == 20
    assert can_threads() == []


async def test_frames_before_a_failure_are_delivered(fake_bus_source, fake_bus, device):
    async with fake_bus_source.connect() as stream:
        send_block(device, fake_bus)
        assert (await anext(stream)).first_index == 0
        send_block(device, fake_bus)
        while fake_bus.messages.qsize():
            await asyncio.sleep(0.001)
        fake_bus.failure = can.CanOperationError("unplugged")
        assert (await anext(stream)).first_index == 50
        with pytest.raises(LinkError, match="unplugged"):
            await anext(stream)


async def test_a_device_with_falling_stamps_is_bad(shape, fake_bus, fake_bus_source, counting_feed):
    """C8: the index goes on, the stamp that does not fit is not used, and says so."""
    feed = counting_feed(n_channels=4)
    device = CanDevice(feed, shape)
    blocks = []
    async with fake_bus_source.connect() as stream:
        for hours in (0, -2, 0, 0):
            feed._start_ns += hours * 3600 * 10**9
            send_block(device, fake_bus)
            feed._start_ns -= hours * 3600 * 10**9
            blocks.append(await anext(stream))
    assert [block.stamp_fault for block in blocks] == [None, None, "stamp_regressed", None]
    assert len(np.unique(np.diff([block.start_ns for block in blocks]) // 10**6)) == 1


FOREIGN = [
    *(
        kind
        for module in (can.exceptions, serial)
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
    """Build an exception; one class takes no argument."""
    return kind() if kind is serial.PortNotOpenError else kind("as seen in the field")


@pytest.mark.parametrize("kind", FOREIGN, ids=lambda kind: kind.__name__)
async def test_what_a_library_raises_on_opening_is_renamed(kind, shape, source_of, monkeypatch):
    def fails(*_, **__):
        raise raised(kind)

    monkeypatch.setattr("can.interfaces.virtual.VirtualBus", fails)
    source = source_of(shape, VIRTUAL)
    with pytest.raises(AcquisitionError, match=WORDS):
        async with source.connect():
            pass
    assert can_threads() == []


@pytest.mark.parametrize("kind", FOREIGN, ids=lambda kind: kind.__name__)
async def test_what_a_library_raises_on_reading_is_renamed(kind, fake_bus_source, fake_bus):
    async with fake_bus_source.connect() as stream:
        fake_bus.failure = raised(kind)
        with pytest.raises(AcquisitionError, match=f"{WORDS}|malformed messages"):
            await anext(stream)
    assert fake_bus.n_shutdowns == 1
    assert can_threads() == []


@pytest.mark.parametrize("kind", [can.CanOperationError, serial.SerialException, OSError])
async def test_errors_of_a_library_on_closing_are_harmless(kind, fake_bus_source, fake_bus, device):
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
            "bitrate must be one of",
        ),
    ],
)
def test_a_bus_that_cannot_be_opened_says_why(link, kind, words):
    with pytest.raises(kind, match=words):
        open_bus(CanLinkSettings(**link), [1])
