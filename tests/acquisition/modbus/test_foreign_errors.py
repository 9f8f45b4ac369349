"""No exception of pymodbus, the socket or the event loop leaves under its own name."""

import inspect
import socket

import pymodbus.exceptions
import pytest
from pymodbus.client import AsyncModbusTcpClient

from acquisition.errors import AcquisitionError, ConfigError, LinkError
from acquisition.modbus.transport import LinkSettings, SerialTransport, TcpTransport

FOREIGN = [
    kind
    for _, kind in inspect.getmembers(pymodbus.exceptions, inspect.isclass)
    if issubclass(kind, Exception)
] + [
    OSError,
    TimeoutError,
    ConnectionResetError,
    ConnectionRefusedError,
    BrokenPipeError,
    socket.gaierror,
    EOFError,
]


@pytest.mark.parametrize("kind", FOREIGN, ids=lambda kind: kind.__name__)
async def test_what_pymodbus_raises_on_a_read_is_renamed(kind, server, monkeypatch, link_to):
    async def fails(*_: object) -> None:
        raise kind("as seen in the field")

    link = link_to(server.port)
    await link.open()
    monkeypatch.setattr(AsyncModbusTcpClient, "execute", fails)
    with pytest.raises(AcquisitionError, match="as seen in the field"):
        await link.read(0, 1)


@pytest.mark.parametrize("kind", FOREIGN, ids=lambda kind: kind.__name__)
async def test_what_pymodbus_raises_on_connecting_is_renamed(kind, monkeypatch, link_to):
    async def fails(*_: object) -> None:
        raise kind("as seen in the field")

    monkeypatch.setattr(AsyncModbusTcpClient, "connect", fails)
    with pytest.raises(AcquisitionError, match="as seen in the field"):
        await link_to(1).open()


async def test_a_name_that_does_not_resolve_is_a_link_error_with_the_reason(link_to):
    with pytest.raises(LinkError, match=r"nowhere\.invalid:502: .*(?i:name|address)"):
        await link_to(502, host="nowhere.invalid", timeout_s=10.0).open()


async def test_a_name_that_cannot_exist_is_a_config_error(link_to):
    with pytest.raises(ConfigError, match="label"):
        await link_to(502, host="a" * 64 + ".example").open()


async def test_a_closed_link_says_so_and_closing_again_is_harmless(server, link_to):
    link = link_to(server.port)
    await link.open()
    link.close()
    link.close()
    with pytest.raises(LinkError, match="closed"):
        await link.read(0, 1)


@pytest.mark.parametrize(
    ("wrong", "complaint"),
    [
        ({"device_id": 256}, "device_id is 256, allowed is 1 to 255"),
        ({"max_registers": 126}, "max_registers is 126, allowed is 1 to 125"),
        ({"timeout_s": 0.0}, "timeout_s is 0.0"),
        ({"timeout_s": float("nan")}, "timeout_s is nan"),
    ],
)
def test_settings_are_refused_with_value_and_limit(wrong, complaint):
    with pytest.raises(ConfigError, match=complaint):
        LinkSettings(transport=TcpTransport(host="127.0.0.1"), **wrong)


@pytest.mark.parametrize(
    ("kind", "wrong", "complaint"),
    [
        (TcpTransport, {"host": "daq", "port": 0}, "port is 0, allowed is 1 to 65535"),
        (SerialTransport, {"device": "/dev/tty", "baudrate": 299}, "baudrate is 299, allowed is"),
        (
            SerialTransport,
            {"device": "/dev/tty", "parity": "mark"},
            "parity is 'mark', allowed are",
        ),
        (SerialTransport, {"device": "/dev/tty", "stop_bits": 3}, "stop_bits is 3, allowed is 1"),
    ],
)
def test_transports_are_refused_with_value_and_limit(kind, wrong, complaint):
    with pytest.raises(ConfigError, match=complaint):
        kind(**wrong)


def test_a_serial_line_has_no_device_beyond_247():
    with pytest.raises(ConfigError, match="device_id is 248, allowed is 1 to 247"):
        LinkSettings(transport=SerialTransport(device="/dev/ttyUSB0"), device_id=248)
