"""Modbus source settings of the plant file, as the adapter takes them."""

from typing import Any

from acquisition.modbus.transport import SerialTransport, TcpTransport, Transport
from service.settings.expected_identity import identity_of
from service.settings.modbus_link import ModbusLinkSettings
from service.settings.modbus_sources import MappedDeviceSettings
from service.settings.sources import ModbusRingSettings

RING_REQUESTS_IN_FLIGHT = 6
"""What a poll of 12 channels takes."""


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


def link_fields(source: ModbusLinkSettings) -> dict[str, Any]:
    """How a device is reached and known, as every source's settings take it."""
    is_per_reply = isinstance(source, MappedDeviceSettings) and source.connection == "per_reply"
    return {
        "transport": transport_of(source),
        "device_id": source.device_id,
        "timeout_s": source.timeout_s,
        "identity": identity_of(source.identity),
        "keeps_connection": not is_per_reply,
        "requests_in_flight": _requests_in_flight(source),
    }


def _requests_in_flight(source: ModbusLinkSettings) -> int:
    if source.requests_in_flight is not None:
        return source.requests_in_flight
    is_ring = isinstance(source, ModbusRingSettings) and source.host is not None
    return RING_REQUESTS_IN_FLIGHT if is_ring else 1
