"""The simulated CAN DAQ: examples, pace, end and faults; and links to simulated serial lines."""

import asyncio
import itertools
import os
from dataclasses import replace
from pathlib import Path

import pytest
from rigs.can import shape_of
from rigs.tiers import first_fast

from acquisition.clock import SystemClock
from acquisition.errors import ConfigError, LinkError
from acquisition.simulated.devices.can_device import CanDevice
from acquisition.simulated.devices.can_server import CanBusServer
from acquisition.simulated.devices.can_shape import CanShape, DaqSignal, dbc_name
from acquisition.simulated.devices.can_slcan import SlcanPtyServer, SlcanTcpServer
from acquisition.simulated.devices.modbus_links import ModbusRtuServer
from acquisition.simulated.devices.ring_device import RingDevice

SHAPE = CanShape(
    channels=(DaqSignal("a", "V"), DaqSignal("b", "V")),
    slow=(DaqSignal("s", "MW"), DaqSignal("t", "MW")),
)


class Terminal:
    """Whoever has an slcan adapter in hand."""

    def __init__(self, endpoint) -> None:
        self._port = int(endpoint["channel"].rpartition(":")[2])

    async def __aenter__(self) -> "Terminal":
        self.reader, self.writer = await asyncio.open_connection("127.0.0.1", self._port)
        return self

    async def __aexit__(self, *_: object) -> None:
        self.writer.close()

    async def ask(self, command: bytes) -> bytes:
        self.writer.write(command)
        return await self.reader.read(1)


@pytest.fixture
def device(counting_feed) -> CanDevice:
    return CanDevice(counting_feed(), SHAPE)


async def test_an_adapter_answers_commands_refuses_to_send_and_has_frames_when_open(device):
    async with SlcanTcpServer(device) as server, Terminal(server.endpoint) as terminal:
        answers = [await terminal.ask(c + b"\r") for c in (b"C", b"S6", b"Y2", b"t1230", b"L")]
        assert answers == [b"\r", b"\r", b"\r", b"\a", b"\r"]
        assert dict(server.commands) == {"C": 1, "S": 1, "Y": 1, "t": 1, "L": 1}
        assert await terminal.reader.readuntil(b"\r") == b"t10080000000007000000\r"
        assert await terminal.reader.readuntil(b"\r") == b"t10180000320003000000\r"


async def test_a_second_reader_takes_the_place_of_the_first(device):
    async with SlcanTcpServer(device) as server, Terminal(server.endpoint) as first:
        await first.ask(b"L\r")
        async with Terminal(server.endpoint) as second:
            while await first.reader.read(10_000):
                pass
            assert await second.ask(b"L\r") == b"\r"


async def test_a_bus_without_text_has_no_faults_of_text_and_cannot_be_cut(device):
    async with CanBusServer(device) as server:
        with pytest.raises(LookupError, match="long_line"):
            server.inject("long_line")
        with pytest.raises(LookupError, match=r"unknown fault cut; known faults: bus_off, drop"):
            server.inject("cut")


async def test_a_port_in_use_is_an_error_that_names_it(device):
    async with SlcanTcpServer(device) as first:
        where = first.endpoint["channel"].removeprefix("socket://")
        with pytest.raises(LinkError, match=f"cannot listen on {where}"):
            await SlcanTcpServer(device, port=int(where.rpartition(":")[2])).__aenter__()


@pytest.mark.long
async def test_a_device_that_nobody_reads_stays_bounded(device):
    device.produce(10_000)
    n_waiting = 0
    while device.has_frames:
        frames = device.next_frames()
        n_waiting += 1
    assert n_waiting == 64
    assert device.ledger.n_samples("U1") == 10_001 * 50
    assert int.from_bytes(frames[0].data[:4], "little") == 10_000 * 50


@pytest.mark.parametrize("patient", [True, False], ids=["patient", "on demand"])
async def test_a_daq_that_waits_for_its_reader_loses_nothing(counting_feed, stepped_clock, patient):
    device = CanDevice(counting_feed(stop_index=15_000), SHAPE)
    how = {"clock": stepped_clock, "patient": True} if patient else {"on_demand": True}
    async with SlcanTcpServer(device, **how) as server:
        for _ in range(100):
            await asyncio.sleep(0)
        assert stepped_clock.monotonic_s() == 0.0
        async with Terminal(server.endpoint) as terminal:
            await terminal.ask(b"L\r")
            running = asyncio.create_task(server.run())
            text = b""
            while text.count(b"t100") < 300:
                text += await terminal.reader.read(65536)
            await running
    heads = [line for line in text.split(b"\r") if line.startswith(b"t100")]
    first = [int.from_bytes(bytes.fromhex(h[5:13].decode()), "little") for h in heads]
    assert first == [50 * n for n in range(300)]
    assert device.ledger.n_samples("U1") == 300 * 50
    assert not patient or stepped_clock.monotonic_s() >= 299 * 50 / 600.0


async def test_an_impatient_daq_goes_on_without_a_reader(counting_feed):
    device = CanDevice(counting_feed(stop_index=150), SHAPE)
    async with SlcanTcpServer(device, SystemClock()) as server:
        while not device.ended:
            await asyncio.sleep(0.01)
        assert server.commands == {}


def test_a_feed_that_does_not_fit_the_shape_is_refused(counting_feed):
    with pytest.raises(ConfigError, match="has 3 channels and 2 slow channels, expected 2 and 2"):
        CanDevice(counting_feed(n_channels=3), SHAPE)
    with pytest.raises(ConfigError, match=r'require profile "padwatch_int16", not "padwatch_f'):
        CanDevice(counting_feed(), replace(SHAPE, floats=True))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"base_id": 0x7FF}, "base_id must be 0 to .* got 2047"),
        ({"base_id": -1}, "base_id must be 0 to .* got -1"),
        ({"channels": ()}, "got 0 and 0"),
        ({"channels": tuple(DaqSignal(f"c{n}", "V") for n in range(33))}, "got 33 and 0"),
    ],
)
def test_a_shape_that_does_not_fit_is_refused(wrong, words):
    with pytest.raises(ConfigError, match=words):
        CanShape(**{"channels": (DaqSignal("x", "V"),)} | wrong)


def test_an_id_becomes_a_name_that_dbc_allows():
    assert [dbc_name(i) for i in ("ujb.shaft-x", "1x", "µ")] == ["ujb_shaft_x", "_1x", "_"]


@pytest.mark.parametrize("numbers", first_fast(1, [(1, 4, 9, 31, 32), range(1, 33)]))
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


@pytest.fixture(params=["modbus", "can"])
def serve(request, counting_feed, counts_calibration):
    def served(link: Path):
        if request.param == "modbus":
            return ModbusRtuServer(RingDevice(counting_feed()), link=link)
        shape = shape_of(counts_calibration(), fd=False)
        return SlcanPtyServer(CanDevice(counting_feed(), shape), link=link)

    return served


async def test_what_a_killed_daq_left_behind_is_replaced_and_cleared(serve, tmp_path):
    line = tmp_path / "line"
    line.symlink_to("/dev/pts/99999")
    async with serve(line):
        assert line.is_char_device()
    assert not line.is_symlink()


@pytest.mark.parametrize("what", ["a port", "a port by its id", "a file"])
async def test_the_port_of_a_real_device_is_never_taken_away(serve, tmp_path, what):
    line = tmp_path / "line"
    if what == "a port by its id":
        line.symlink_to("/dev/ttyUSB0")
    elif what == "a file":
        line.write_text("kept")
    else:
        os.mkfifo(line)
    before = line.lstat()
    with pytest.raises(ConfigError, match=f"{line}: the path is in use; .* a free path"):
        await serve(line).__aenter__()
    after = line.lstat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


async def test_a_link_that_cannot_be_made_is_a_lost_link(serve, tmp_path):
    with pytest.raises(LinkError, match="nowhere/line: the link cannot be created: No such file"):
        await serve(tmp_path / "nowhere" / "line").__aenter__()
