"""What can be read from a device, over TCP and RTU alike, and that nothing can be written."""

import struct
from functools import partial

import pytest

from acquisition.errors import ConfigError, FrameError, LinkError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.identity import ExpectedIdentification, ExpectedRegisters, Identification
from acquisition.modbus.ring_source import RingSettings
from acquisition.modbus.transport import ConnectionUse, LinkSettings, SerialTransport, TcpTransport
from acquisition.simulated.devices.modbus_links import ModbusTcpServer


async def test_every_kind_of_read_brings_what_the_device_has(linked, bench_server, bench):
    link = linked()
    await link.open()
    assert await link.read(100, 60) == bytes(range(120))
    assert await link.read(101, 3, function=4) == bytes(range(2, 8))
    assert await link.read(8, 12, function=2) == bench.bits[1:3]
    assert await link.read(8, 12, function=1) == bytes(2)
    assert await link.read_fifos([7, 8]) == [bytes(range(62)), b""]
    assert await link.identify() == Identification("Acme", "DAQ-12", "1.4")
    assert bench_server.function_codes == {3: 1, 4: 1, 2: 1, 1: 1, 0x18: 2, 43: 1}


async def test_a_long_read_is_split_at_what_the_device_gives_at_once(linked, bench_server, bench):
    link = linked(max_registers=7)
    await link.open()
    assert await link.read(100, 100) == bytes(range(200))
    assert bench_server.function_codes == {3: 15}
    bench.bits = bytes(range(251)) * 2
    assert await link.read(0, 3000, function=2) == bench.bits[:375]
    assert bench_server.function_codes[2] == 2


async def test_a_queue_that_claims_more_than_31_registers_is_refused(linked):
    link = linked()
    await link.open()
    with pytest.raises(FrameError, match="FIFO count is 32, allowed is 0 to 31"):
        await link.read_fifos([9])


async def test_what_the_device_does_not_have_is_a_config_error_that_says_what_was_asked(linked):
    link = linked()
    await link.open()
    asked = r"exception 2 \(illegal address\) to a read of 2 at 399, function 4"
    with pytest.raises(ConfigError, match=asked):
        await link.read(399, 2, function=4)
    with pytest.raises(ConfigError, match="a read of the queue at 10"):
        await link.read_fifos([10])


@pytest.mark.parametrize(
    ("ask", "complaint"),
    [
        (lambda link: link.read(65_535, 2), "2 at 65535 are asked, addresses are 0 to 65535"),
        (lambda link: link.read(-1, 1), "1 at -1 are asked"),
        (lambda link: link.read(0, 0), "0 at 0 are asked"),
        (lambda link: link.read(0, 1, function=6), "function is 6, allowed are 1, 2, 3 and 4"),
        (lambda link: link.read(0, 1, function=5), "function is 5, allowed are"),
        (lambda link: link.read_fifos([65_536]), "1 at 65536 are asked"),
    ],
)
async def test_what_no_device_can_have_is_never_asked(ask, complaint, linked, bench_server):
    link = linked()
    await link.open()
    with pytest.raises(ConfigError, match=complaint):
        await ask(link)
    assert not bench_server.function_codes


@pytest.mark.parametrize("in_flight", [2, 6, 16])
async def test_many_requests_in_flight_bring_the_same(bench, in_flight):
    async with ModbusTcpServer(bench) as server:
        transport = TcpTransport(host="127.0.0.1", port=server.port)
        link = ModbusClient(
            LinkSettings(transport=transport, max_registers=7, requests_in_flight=in_flight)
        )
        await link.open()
        assert await link.read(100, 100) == bytes(range(200))
        server.inject("busy", 3)
        assert await link.read(100, 100) == bytes(range(200))
        with pytest.raises(ConfigError, match="illegal address"):
            await link.read(390, 20)
        assert await link.read(100, 1) == b"\0\1"
        link.close()


async def test_a_busy_device_is_asked_again_on_the_same_connection(linked, bench_server):
    link = linked()
    await link.open()
    bench_server.inject("busy", 3)
    assert await link.read(100, 1) == b"\0\1"
    assert bench_server.function_codes[3] == 4


async def test_a_device_that_stays_busy_is_not_waited_for_for_ever(linked, bench_server):
    link = linked(timeout_s=0.1)
    await link.open()
    bench_server.inject("busy", 1000)
    with pytest.raises(LinkError, match=r"exception 6 \(busy\) to a read of 1 at 100"):
        await link.read(100, 1)
    assert 2 <= bench_server.function_codes[3] <= 4


TCP = TcpTransport(host="127.0.0.1")
LINE = SerialTransport(device="/dev/ttyUSB0")
tcp, line = partial(TcpTransport, host="daq"), partial(SerialTransport, device="/dev/tty")
on_tcp, on_line = partial(LinkSettings, transport=TCP), partial(LinkSettings, transport=LINE)
ring = partial(RingSettings, transport=TCP)


@pytest.mark.parametrize(
    ("kind", "wrong", "complaint"),
    [
        (tcp, {"port": 0}, "port is 0, allowed is 1 to 65535"),
        (line, {"baudrate": 299}, "baudrate is 299, allowed is"),
        (line, {"parity": "mark"}, "parity is 'mark', allowed"),
        (line, {"stop_bits": 3}, "stop_bits is 3, allowed is 1"),
        (on_tcp, {"device_id": 256}, "device_id is 256, allowed is 1 to 255"),
        (on_line, {"device_id": 248}, "device_id is 248, allowed is 1 to 247"),
        (on_tcp, {"max_registers": 126}, "max_registers is 126, allowed is 1"),
        (on_tcp, {"timeout_s": 0.0}, "timeout_s is 0.0"),
        (on_tcp, {"timeout_s": float("nan")}, "timeout_s is nan"),
        (on_line, {"connection": ConnectionUse.PER_REPLY}, "serial line is kept"),
        (on_line, {"requests_in_flight": 2}, "requests_in_flight is 2, allowed is 1 to 1"),
        (on_tcp, {"requests_in_flight": 17}, "requests_in_flight is 17, allowed is 1 to 16"),
        (ring, {"function": 6}, "function is 6, allowed is 3 to 4"),
        (ring, {"base_address": 65521}, "allowed is 0 to 65520"),
        (ring, {"poll_period_s": 0.0}, "poll_period_s is 0.0, must"),
        (ring, {"stale_after_s": float("inf")}, "stale_after_s is inf"),
    ],
)
def test_what_cannot_be_is_refused_with_value_and_limit(kind, wrong, complaint):
    with pytest.raises(ConfigError, match=complaint):
        kind(**wrong)


async def test_the_expected_device_is_read_and_another_one_is_not(linked, bench_server):
    for identity in (
        ExpectedRegisters(address=101, words=(0x0203, 0x0405)),
        ExpectedRegisters(address=101, words=(0x0203,), function=4),
        ExpectedIdentification(vendor="Acme"),
        ExpectedIdentification(product_code="DAQ-12", revision="1.4"),
    ):
        link = linked(identity=identity)
        await link.open()
        assert await link.read(100, 1) == b"\0\1"
        link.close()
    bench_server.inject("word_order")  # one changed reply does not make another device
    await linked(identity=ExpectedRegisters(address=101, words=(0x0203, 0x0405))).open()


@pytest.mark.parametrize(
    ("identity", "complaint"),
    [
        (
            ExpectedRegisters(address=101, words=(0x0203, 0x0406)),
            "registers at 101 are 0x0203 0x0405, expected are 0x0203 0x0406",
        ),
        (ExpectedIdentification(vendor="Emca"), "vendor is 'Acme', expected is 'Emca'"),
        (
            ExpectedIdentification(vendor="Acme", product_code="DAQ-24"),
            "product_code is 'DAQ-12', expected is 'DAQ-24'",
        ),
        (ExpectedIdentification(revision="1.5"), "revision is '1.4', expected is '1.5'"),
    ],
)
async def test_another_device_is_refused_with_found_and_expected(identity, complaint, linked):
    link = linked(identity=identity)
    with pytest.raises(ConfigError, match=f"{link.where}: another device answers: its {complaint}"):
        await link.open()


async def test_a_device_without_identification_is_not_the_expected_one(linked, bench):
    bench.identification = {}
    with pytest.raises(ConfigError, match=r"illegal function.*its identification"):
        await linked(identity=ExpectedIdentification(vendor="Acme")).open()


async def test_an_identification_that_is_no_text_is_shown_and_does_no_harm(linked, bench):
    bench.identification = {0: b"\xff\0\0", 1: bytes(100), 2: b"1.4\0"}
    link = linked()
    await link.open()
    assert await link.identify() == Identification("\\xff", "", "1.4")


def test_a_signature_is_made_of_words():
    for words in ((), (0x10000,), (-1,)):
        with pytest.raises(ConfigError, match="signature is"):
            ExpectedRegisters(address=0, words=words)


async def test_an_identification_in_parts_is_read_to_its_end_and_one_without_end_is_refused(
    linked, bench_server
):
    def part(request, _):
        more, following = (0xFF, 1) if request[3] == 0 else (0, 0)
        return struct.pack(">7B", 43, 14, 1, 0x81, more, following, 1) + bytes(
            (request[3], 1, 65 + request[3])
        )

    link = linked()
    await link.open()
    bench_server._reply_faults.extend([part] * 2)
    assert await link.identify() == Identification("A", "B", "")
    endless = struct.pack(">7B", 43, 14, 1, 0x81, 0xFF, 0, 0)
    bench_server._reply_faults.extend([lambda *_: endless] * 8)
    with pytest.raises(FrameError, match="no end"):
        await link.identify()
