"""The device that is expected is told from any other, and a bad identification does no harm."""

import struct

import pytest
from pymodbus.pdu import ModbusPDU

from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.framing import TcpFramer
from acquisition.modbus.identification import Identification
from acquisition.modbus.identity import ExpectedIdentification, Signature


@pytest.mark.parametrize("request_data", [b"", b"\x0d\x01\x00", b"\x0e\x00\x00", b"\x0e\x05\x00"])
def test_function_43_is_only_sent_to_read_an_identification(request_data):
    class Other(ModbusPDU):
        function_code = 43

        def encode(self) -> bytes:
            return request_data

    with pytest.raises(ConfigError, match="function code 43 is never sent"):
        TcpFramer().buildFrame(Other())


async def test_the_expected_device_is_read_and_another_one_is_not(linked, bench_server):
    for identity in (
        Signature(address=101, words=(0x0203, 0x0405)),
        Signature(address=101, words=(0x0203,), function=4),
        ExpectedIdentification(vendor="Acme"),
        ExpectedIdentification(product_code="DAQ-12", revision="1.4"),
    ):
        link = linked(identity=identity)
        await link.open()
        assert await link.read(100, 1) == b"\0\1"
        link.close()
    bench_server.inject("word_order")  # one changed reply does not make another device
    await linked(identity=Signature(address=101, words=(0x0203, 0x0405))).open()


@pytest.mark.parametrize(
    ("identity", "complaint"),
    [
        (
            Signature(address=101, words=(0x0203, 0x0406)),
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
            Signature(address=0, words=words)


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
