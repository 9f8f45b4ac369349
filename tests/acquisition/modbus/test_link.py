"""What can be read from a device, over TCP and RTU alike, and that nothing can be written."""

import inspect

import pytest
from pymodbus.pdu import ModbusPDU

from acquisition.errors import ConfigError, FrameError, LinkError
from acquisition.modbus.identification import Identification


async def test_every_kind_of_read_brings_what_the_device_has(linked, bench_server, bench):
    link = linked()
    await link.open()
    assert await link.read(100, 60) == bytes(range(120))
    assert await link.read(101, 3, function=4) == bytes(range(2, 8))
    assert await link.read_bits(8, 12) == bench.bits[1:3]
    assert await link.read_bits(8, 12, function=1) == bytes(2)
    assert await link.read_fifo(7) == bytes(range(62))
    assert await link.read_fifo(8) == b""
    assert await link.identify() == Identification("Acme", "DAQ-12", "1.4")
    assert bench_server.function_codes == {3: 1, 4: 1, 2: 1, 1: 1, 0x18: 2, 43: 1}


async def test_a_long_read_is_split_at_what_the_device_gives_at_once(linked, bench_server, bench):
    link = linked(max_registers=7)
    await link.open()
    assert await link.read(100, 100) == bytes(range(200))
    assert bench_server.function_codes == {3: 15}
    bench.bits = bytes(range(251)) * 2
    assert await link.read_bits(0, 3000) == bench.bits[:375]
    assert bench_server.function_codes[2] == 2


async def test_a_queue_that_claims_more_than_31_registers_is_refused(linked):
    link = linked()
    await link.open()
    with pytest.raises(FrameError, match="FIFO count is 32, allowed is 0 to 31"):
        await link.read_fifo(9)


async def test_what_the_device_does_not_have_is_a_config_error_that_says_what_was_asked(linked):
    link = linked()
    await link.open()
    asked = r"exception 2 \(illegal address\) to a read of 2 at 399, function 4"
    with pytest.raises(ConfigError, match=asked):
        await link.read(399, 2, function=4)
    with pytest.raises(ConfigError, match="a read of the queue at 10"):
        await link.read_fifo(10)


@pytest.mark.parametrize(
    ("ask", "complaint"),
    [
        (lambda link: link.read(65_535, 2), "2 at 65535 are asked, addresses are 0 to 65535"),
        (lambda link: link.read(-1, 1), "1 at -1 are asked"),
        (lambda link: link.read(0, 0), "0 at 0 are asked"),
        (lambda link: link.read(0, 1, function=6), r"function is 6, allowed are \[3, 4\]"),
        (lambda link: link.read_bits(0, 1, function=5), r"function is 5, allowed are \[1, 2\]"),
        (lambda link: link.read_fifo(65_536), "1 at 65536 are asked"),
    ],
)
async def test_what_no_device_can_have_is_never_asked(ask, complaint, linked, bench_server):
    link = linked()
    await link.open()
    with pytest.raises(ConfigError, match=complaint):
        await ask(link)
    assert not bench_server.function_codes


async def test_a_busy_device_may_be_asked_again_on_the_same_connection(linked, bench_server):
    link = linked()
    await link.open()
    bench_server.inject("busy", 2)
    for _ in range(2):
        with pytest.raises(LinkError, match=r"exception 6 \(busy\) to a read of 1 at 100"):
            await link.read(100, 1)
    assert await link.read(100, 1) == b"\0\1"


def requests_of_pymodbus() -> list[type[ModbusPDU]]:
    """Every request that pymodbus can send."""
    kinds: list[type[ModbusPDU]] = [ModbusPDU]
    for kind in kinds:
        kinds += kind.__subclasses__()
    found = {kind for kind in kinds if kind.__name__.endswith("Request")}
    return sorted(found, key=lambda kind: kind.__name__)


READS = {
    "ReadCoilsRequest",
    "ReadDeviceInformationRequest",
    "ReadDiscreteInputsRequest",
    "ReadFifoQueueRequest",
    "ReadHoldingRegistersRequest",
    "ReadInputRegistersRequest",
}


def arguments_of(kind: type[ModbusPDU]) -> dict[str, object]:
    known = {"address": 100, "count": 1, "registers": [1], "bits": [True]}
    return {name: known[name] for name in inspect.signature(kind).parameters if name in known}


def test_pymodbus_has_more_requests_than_may_be_sent():
    assert {kind.__name__ for kind in requests_of_pymodbus()} > READS
    assert len(requests_of_pymodbus()) > 15


@pytest.mark.parametrize("kind", requests_of_pymodbus(), ids=lambda kind: kind.__name__)
async def test_nothing_but_reads_ever_reaches_the_wire(kind, linked, bench_server):
    link = linked()
    await link.open()
    request = kind(**arguments_of(kind))
    if kind.__name__ in READS:
        await link._connection.ask(request, "a read")
        assert list(bench_server.function_codes) == [kind.function_code]
        return
    with pytest.raises(ConfigError, match="is never sent"):
        await link._connection.ask(request, "a write")
    assert not bench_server.function_codes
