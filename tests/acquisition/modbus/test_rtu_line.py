"""A serial line: one wire for everybody, on which a late reply could be anybody's."""

import asyncio

import pytest

from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.transport import SerialTransport


async def test_a_reply_that_comes_too_late_is_never_taken_for_the_next_one(hostile_line, link_on):
    link = link_on(hostile_line.path, timeout_s=0.1)
    held_back = []

    async def keep(request, reply, line):  # noqa: ARG001
        held_back.append(reply)

    await link.open()
    right = await link.read(1, 1)
    hostile_line.lie = keep
    with pytest.raises(LinkError, match=r"no reply within 0\.1 s"):
        await link.read(0, 1)
    with pytest.raises(LinkError, match="closed"):
        await link.read(1, 1)
    assert len(hostile_line.requests) == 2
    hostile_line.lie = None
    opening = asyncio.create_task(link.open())
    while not link._protocol.is_open:
        await asyncio.sleep(0)
    hostile_line.write(held_back[0])  # the same function, unit and length: only time can tell
    await opening
    assert await link.read(1, 1) == right
    link.close()


async def test_a_line_is_only_used_when_it_is_silent(hostile_line, link_on):
    link = link_on(hostile_line.path, timeout_s=0.2)

    async def babble() -> None:
        while True:
            hostile_line.write(b"\x55")
            await asyncio.sleep(0.01)

    babbling = asyncio.create_task(babble())
    with pytest.raises(LinkError, match=r"not silent for 0\.2 s within 1 s: .* bytes"):
        await link.open()
    babbling.cancel()
    assert not hostile_line.requests
    await link.open()
    link.close()


@pytest.mark.parametrize(
    ("name", "complaint"),
    [("nowhere", "nowhere: No such file or directory"), ("plain", r"plain: .*configure port")],
)
async def test_what_is_no_port_is_a_link_error_that_names_it(name, complaint, link_on, tmp_path):
    (tmp_path / "plain").write_bytes(b"")
    with pytest.raises(LinkError, match=complaint):
        await link_on(tmp_path / name).open()


async def test_two_programs_cannot_read_one_line(hostile_line, link_on):
    first, second = (link_on(hostile_line.path, timeout_s=0.05) for _ in range(2))
    await first.open()
    with pytest.raises(LinkError, match="line: the port is in use by another program"):
        await second.open()
    first.close()


async def test_settings_that_a_port_refuses_are_a_config_error(hostile_line, link_on):
    link = link_on(hostile_line.path, parity="even")  # a pseudo-terminal has no parity
    for _ in range(2):  # the first try leaves the port to the second
        with pytest.raises(ConfigError, match="line: the port rejects the settings"):
            await link.open()


def test_a_character_is_as_long_as_its_bits():
    line = SerialTransport(device="/dev/ttyUSB0", baudrate=9600, parity="even", stop_bits=1)
    assert line.character_s == pytest.approx(11 / 9600)
    assert line.frame_gap_s == pytest.approx(3.5 * 11 / 9600)
    fast = SerialTransport(device="/dev/ttyUSB0", baudrate=115_200, parity="none")
    assert fast.frame_gap_s == 0.00175
