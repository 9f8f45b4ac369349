"""No exception of pymodbus, the socket or the event loop leaves under its own name."""

import inspect
import socket
import termios

import pymodbus.exceptions
import pytest
import serial.serialutil
from pymodbus.client.base import ModbusBaseClient

from acquisition.errors import AcquisitionError, ConfigError, LinkError

FOREIGN = [
    kind
    for module in (pymodbus.exceptions, serial.serialutil)
    for _, kind in inspect.getmembers(module, inspect.isclass)
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


@each_foreign_error
async def test_what_pymodbus_raises_is_renamed(kind, server, monkeypatch, link_to):
    async def fails(*_: object) -> None:
        raise field_error(kind)

    link = link_to(server.port)
    await link.open()
    monkeypatch.setattr(ModbusBaseClient, "execute", fails)
    with pytest.raises(AcquisitionError, match=TEXT):
        await link.read(0, 1)
    monkeypatch.setattr(ModbusBaseClient, "connect", fails)
    with pytest.raises(AcquisitionError, match=TEXT):
        await link.open()


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
