"""A serial line, one wire for everybody; errors of line, socket and event loop are renamed."""

import asyncio
import inspect
import socket
import termios

import pytest
import serial.serialutil

from acquisition.errors import AcquisitionError, ConfigError, LinkError
from acquisition.modbus.transport import SerialTransport


async def test_a_reply_that_comes_too_late_is_never_taken_for_the_next_one(hostile_line, link_on):
    link = link_on(hostile_line.path, timeout_s=0.5)
    held_back = []

    async def keep(request, reply, line):  # noqa: ARG001
        held_back.append(reply)

    await link.open()
    right = await link.read(1, 1)
    hostile_line.lie = keep
    with pytest.raises(LinkError, match=r"no reply within 0\.5 s"):
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
    with pytest.raises(LinkError, match=r"not silent for 0\.2 s within 1 s; received .* bytes"):
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


FOREIGN = [
    kind
    for _, kind in inspect.getmembers(serial.serialutil, inspect.isclass)
    if issubclass(kind, Exception)
] + [
    termios.error,
    OSError,
    TimeoutError,
    ConnectionResetError,
    ConnectionRefusedError,
    BrokenPipeError,
    socket.gaierror,
    EOFError,
]


def field_error(kind: type[Exception]) -> Exception:
    """An instance of a class, with a text wherever it takes one."""
    if kind is serial.PortNotOpenError:
        return kind()
    return kind("as seen in the field")


TEXT = "as seen in the field|Attempting to use a port that is not open"


each_foreign_error = pytest.mark.parametrize("kind", FOREIGN, ids=lambda kind: kind.__name__)


@pytest.mark.parametrize(
    "kind", [kind for kind in FOREIGN if issubclass(kind, OSError)], ids=lambda kind: kind.__name__
)
async def test_what_the_event_loop_raises_is_renamed(kind, server, monkeypatch, link_to):
    async def fails(*_: object) -> None:
        raise field_error(kind)

    loop = asyncio.get_running_loop()
    with monkeypatch.context() as patched:
        patched.setattr(type(loop), "create_connection", fails)
        with pytest.raises(LinkError, match=f"{TEXT}|no connection within"):
            await link_to(server.port).open()
    link = link_to(server.port)
    await link.open()
    reading = asyncio.create_task(link.read(0, 1))
    await asyncio.sleep(0)
    link._protocol.connection_lost(field_error(kind))
    with pytest.raises(LinkError, match=f"closed the connection: {TEXT}"):
        await reading
    link.close()


@each_foreign_error
async def test_what_a_serial_port_raises_is_renamed(kind, hostile_line, monkeypatch, link_on):
    def fails(*_: object) -> None:
        raise field_error(kind)

    link = link_on(hostile_line.path, timeout_s=0.3)
    with monkeypatch.context() as patched:
        patched.setattr(serial.Serial, "open", fails)
        with pytest.raises(AcquisitionError):
            await link.open()
    await link.open()
    if issubclass(kind, serial.SerialException):
        monkeypatch.setattr(serial.Serial, "read", fails)
        with pytest.raises(LinkError, match="closed the connection"):
            await link.read(0, 1)
    link.close()


async def test_a_name_that_does_not_resolve_or_cannot_exist_is_told_with_the_reason(link_to):
    with pytest.raises(LinkError, match=r"nowhere\.invalid:502: .*(?i:name|address)"):
        await link_to(502, host="nowhere.invalid", timeout_s=10.0).open()
    with pytest.raises(ConfigError, match="label"):
        await link_to(502, host="a" * 64 + ".example").open()


async def test_a_closed_link_says_so_and_closing_again_is_harmless(server, link_to):
    link = link_to(server.port)
    await link.open()
    link.close()
    link.close()
    with pytest.raises(LinkError, match="closed"):
        await link.read(0, 1)
