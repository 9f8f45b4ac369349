"""Conversion of Modbus and recording settings to settings of the acquisition adapters."""

from typing import TypeVar

from acquisition.modbus.transport import (
    ExpectedRegisters,
    Identification,
    Identity,
    LinkSettings,
    SerialTransport,
    TcpTransport,
    Transport,
)
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
        slow_channels=tuple(
            RecordedSlowChannel(**slow.model_dump(include=set(RecordedSlowChannel.model_fields)))
            for slow in unit.slow_channel
        ),
        block_samples=unit.block_samples,
    )


def identity_of(settings: IdentitySettings | None) -> Identity | None:
    """Return the expected identity of a device; None if any device is accepted."""
    match settings:
        case SignatureIdentity():
            return ExpectedRegisters(**settings.values_for(ExpectedRegisters))
        case IdentificationIdentity():
            return Identification(**settings.values_for(Identification))
        case None:
            return None


RING_REQUESTS_IN_FLIGHT = 16
"""Default number of concurrent requests to a block ring, the maximum of Modbus Messaging on TCP/IP
Implementation Guide 1.0b, 4.4: half a second of 12 channels takes two round trips."""


def transport_of(source: ModbusLinkSettings) -> Transport:
    """Return the transport of a Modbus device: TCP or serial line."""
    if source.host is not None:
        return TcpTransport(host=source.host, port=source.port)
    return SerialTransport(**source.values_for(SerialTransport))


Link = TypeVar("Link", bound=LinkSettings)


def link_settings(kind: type[Link], source: ModbusLinkSettings) -> Link:
    """Return the settings of a Modbus device as an instance of ``kind``, a class of its adapter.

    Unless set, `requests_in_flight` is `RING_REQUESTS_IN_FLIGHT` for a block ring on TCP, else 1.
    """
    is_per_reply = isinstance(source, MappedDeviceSettings) and source.connection == "per_reply"
    is_ring = isinstance(source, ModbusRingSettings) and source.host is not None
    own = {
        "transport": transport_of(source),
        "identity": identity_of(source.identity),
        "keeps_connection": not is_per_reply,
        "requests_in_flight": source.requests_in_flight
        or (RING_REQUESTS_IN_FLIGHT if is_ring else 1),
    }
    return kind(**source.values_for(kind) | own)
