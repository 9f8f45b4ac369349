"""Modbus source settings of the plant file, as the adapter takes them."""

from typing import Any

from acquisition.modbus.transport import SerialTransport, TcpTransport, Transport
from service.settings.modbus_link import ModbusLinkSettings

_TRANSPORT_KEYS = {"host", "port", "device", "baudrate", "parity", "stop_bits"}


def transport_of(source: ModbusLinkSettings) -> Transport:
    """Where a Modbus device is: on the network, or on a serial line."""
    if source.host is not None:
        return TcpTransport(host=source.host, port=source.port)
    return SerialTransport(
        device=source.device or "",
        baudrate=source.baudrate,
        parity=source.parity,
        stop_bits=source.stop_bits,
    )


def fields_of(source: ModbusLinkSettings) -> dict[str, Any]:
    """All other settings of a source, by name."""
    return source.model_dump(exclude={"kind", *_TRANSPORT_KEYS})
