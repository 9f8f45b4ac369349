"""What can be read from a device, over TCP and RTU alike, and that nothing can be written."""

import struct

import pytest

from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.requests import Span
from acquisition.modbus.transport import (
    ExpectedRegisters,
    Identification,
    LinkSettings,
    TcpTransport,
)
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


async def test_a_long_read_is_split_at_what_a_read_can_have(linked, bench_server, bench):
    link = linked()
    await link.open()
    bench.memory.write(100, bytes(range(251)) * 2)
    assert await link.read(100, 251) == bytes(range(251)) * 2
    assert bench_server.function_codes == {3: 3}
    bench.bits = bytes(range(251)) * 2
    assert await link.read(0, 3000, function=2) == bench.bits[:375]
    assert bench_server.function_codes[2] == 2


async def test_a_queue_that_claims_more_than_31_registers_is_refused(linked):
    link = linked()
    await link.open()
    with pytest.raises(LinkError, match="FIFO count must be 0 to 31, got 32"):
        await link.read_fifos([9])


async def test_what_the_device_does_not_have_is_a_config_error_that_says_what_was_asked(linked):
    link = linked()
    await link.open()
    asked = r"exception 2 \(illegal data address\) for a read of 2 at 399, function 4"
    with pytest.raises(ConfigError, match=asked):
        await link.read(399, 2, function=4)
    with pytest.raises(ConfigError, match="a read of the FIFO queue at 10"):
        await link.read_fifos([10])


@pytest.mark.parametrize(
    ("ask", "complaint"),
    [
        (lambda link: link.read(65_535, 2), "from 0 to 65535, got 2 addresses from 65535"),
        (lambda link: link.read(-1, 1), "got 1 addresses from -1"),
        (lambda link: link.read(0, 0), "got 0 addresses from 0"),
        (lambda link: link.read(0, 1, function=6), "function must be 1, 2, 3 or 4, got 6"),
        (lambda link: link.read(0, 1, function=5), "function must be 1, 2, 3 or 4, got 5"),
        (lambda link: link.read_fifos([65_536]), "got 1 addresses from 65536"),
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
        link = ModbusClient(LinkSettings(transport=transport, requests_in_flight=in_flight))
        await link.open()
        spans = [Span(at, min(7, 200 - at)) for at in range(100, 200, 7)]
        for n_busy in (0, 3):
            server.inject("busy", n_busy)
            assert await link.read_spans(spans) == bytes(range(200))
        with pytest.raises(ConfigError, match="illegal data address"):
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
    with pytest.raises(
        LinkError, match=r"exception 6 \(server device busy\) for a read of 1 at 100"
    ):
        await link.read(100, 1)
    assert 2 <= bench_server.function_codes[3] <= 4


def test_a_port_that_only_a_simulated_device_may_have_is_refused():
    with pytest.raises(ConfigError, match="port must be 1 to 65535, got 0"):
        TcpTransport(host="daq", port=0)


async def test_the_expected_device_is_read_and_another_one_is_not(linked, bench_server):
    for identity in (
        ExpectedRegisters(address=101, words=(0x0203, 0x0405)),
        ExpectedRegisters(address=101, words=(0x0203,), function=4),
        Identification(vendor="Acme"),
        Identification(product_code="DAQ-12", revision="1.4"),
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
            "registers from 101 are 0x0203 0x0405, expected 0x0203 0x0406",
        ),
        (Identification(vendor="Emca"), "vendor is 'Acme', expected 'Emca'"),
        (
            Identification(vendor="Acme", product_code="DAQ-24"),
            "product_code is 'DAQ-12', expected 'DAQ-24'",
        ),
        (Identification(revision="1.5"), "revision is '1.4', expected '1.5'"),
    ],
)
async def test_another_device_is_refused_with_found_and_expected(identity, complaint, linked):
    link = linked(identity=identity)
    with pytest.raises(ConfigError, match=f"{link.where}: wrong device: {complaint}"):
        await link.open()


async def test_a_device_without_identification_is_not_the_expected_one(linked, bench):
    bench.identification = {}
    with pytest.raises(ConfigError, match=r"illegal function.*the device identification"):
        await linked(identity=Identification(vendor="Acme")).open()


async def test_an_identification_that_is_no_text_is_shown_and_does_no_harm(linked, bench):
    bench.identification = {0: b"\xff\0\0", 1: bytes(100), 2: b"1.4\0"}
    link = linked()
    await link.open()
    assert await link.identify() == Identification("\\xff", "", "1.4")


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
    with pytest.raises(LinkError, match="identification takes more than"):
        await link.identify()
