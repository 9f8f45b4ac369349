"""Conversion of Modbus and recording settings to settings of the acquisition adapters."""

from typing import Any

from acquisition.modbus.identity import ExpectedIdentification, ExpectedRegisters, Identity
from acquisition.modbus.transport import SerialTransport, TcpTransport, Transport
from acquisition.recordings.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from service.settings.sources.devices import MappedDeviceSettings, ModbusRingSettings
from service.settings.sources.modbus import (
    IdentificationIdentity,
    IdentitySettings,
    ModbusLinkSettings,
    SignatureIdentity,
)
from service.settings.units import UnitSettings


def recorded_unit(unit: UnitSettings) -> RecordedUnit:
    """Return the channels and the calibration of a unit for the manifests of its recordings."""
    return RecordedUnit(
        unit=unit.id,
        rate_hz=unit.sampling_hz,
        channels=tuple(
            RecordedChannel(id=channel.id, measurand=channel.measurand, **channel.scale)
            for channel in unit.channel
        ),
        slow_channels=tuple(RecordedSlowChannel(**slow.model_dump()) for slow in unit.slow_channel),
        block_samples=unit.block_samples,
    )


def identity_of(settings: IdentitySettings | None) -> Identity | None:
    """Return the expected identity of a device; None if any device is accepted."""
    match settings:
        case SignatureIdentity():
            return ExpectedRegisters(
                address=settings.address, words=settings.words, function=settings.function
            )
        case IdentificationIdentity():
            return ExpectedIdentification(
                vendor=settings.vendor,
                product_code=settings.product_code,
                revision=settings.revision,
            )
        case None:
            return None


RING_REQUESTS_IN_FLIGHT = 6
"""Default number of concurrent requests to a block ring: one poll of 12 channels."""


def transport_of(source: ModbusLinkSettings) -> Transport:
    """Return the transport of a Modbus device: TCP or serial line."""
    if source.host is not None:
        return TcpTransport(host=source.host, port=source.port)
    return SerialTransport(
        device=source.device or "",
        baudrate=source.baudrate,
        parity=source.parity,
        stop_bits=source.stop_bits,
    )


def link_fields(source: ModbusLinkSettings) -> dict[str, Any]:
    """Return the connection and identity fields that the settings of all Modbus adapters share."""
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
