"""No exception of the socket, the serial port or the event loop leaves under its own name."""

import asyncio
import inspect
import socket
import termios

import pytest
import serial.serialutil

from acquisition.errors import AcquisitionError, ConfigError, LinkError

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

    link = link_on(hostile_line.path, timeout_s=0.05)
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
