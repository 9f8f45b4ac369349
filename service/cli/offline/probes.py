"""One look into a Modbus device: connect, read once, leave."""

from dataclasses import replace

from acquisition.errors import AcquisitionError
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.decoding import MapDecoder
from acquisition.modbus.identity import Identification
from acquisition.modbus.polled_source import MapReader
from acquisition.modbus.register_map import RegisterMap
from acquisition.modbus.requests import Span
from acquisition.modbus.ring_follower import RingReader
from acquisition.modbus.ring_profile import RingHeader, Slot
from acquisition.modbus.transport import LinkSettings
from service.settings.modbus_devices import link_fields
from service.settings.modbus_link import ModbusLinkSettings

_TRIES_IN_FLIGHT = 20


def link_settings_of(device: ModbusLinkSettings) -> LinkSettings:
    """How a device is reached."""
    return LinkSettings(**link_fields(device))


async def read_once(device: ModbusLinkSettings, function: int, address: int, count: int) -> bytes:
    """Read registers, big-endian words, or bits, eight in a byte.

    Raises
    ------
    LinkError
        If the device does not answer, or answers nonsense.
    ConfigError
        If it has no such registers.
    """
    client = ModbusClient(link_settings_of(device))
    async with client.connected():
        return await client.read(address, count, function)


async def read_map_once(
    device: ModbusLinkSettings, registers: RegisterMap
) -> tuple[MapDecoder, bytes]:
    """Check the signature, then read everything that a map names.

    Raises
    ------
    LinkError, ConfigError
        As `read_once`; ConfigError too if it is another device.
    """
    decoder = MapDecoder(registers)
    reader = MapReader(link_settings_of(device), decoder)
    async with reader.connected():
        return decoder, await reader.content()


async def read_ring_once(
    device: ModbusLinkSettings, base_address: int, function: int
) -> tuple[RingHeader, Slot]:
    """Read a block ring's header and its newest slot.

    Raises
    ------
    LinkError, ConfigError
        As `read_once`; ConfigError too if this is no block ring.
    """
    client = ModbusClient(link_settings_of(device))
    reader = RingReader(client, base_address, function)
    async with client.connected():
        header = await reader.header()
        [slot] = await reader.slots(header.layout, [header.newest])
        return header, slot


async def identify_once(device: ModbusLinkSettings) -> Identification:
    """Ask a device who it is.

    Raises
    ------
    LinkError, ConfigError
        As `read_once`; ConfigError too if it does not say.
    """
    client = ModbusClient(link_settings_of(device))
    async with client.connected():
        return await client.identify()


async def measure_in_flight(
    device: ModbusLinkSettings, address: int, function: int, most: int
) -> int:
    """Try how many requests a device answers in order when they are sent at once.

    Parameters
    ----------
    address
        Of a register that it has.

    Returns
    -------
    At least 1.

    Raises
    ------
    LinkError, ConfigError
        As `read_once`, of a single request.
    """
    await read_once(device, address, 1, function)
    n_taken = 1
    for n_requests in range(2, most + 1):
        client = ModbusClient(replace(link_settings_of(device), requests_in_flight=n_requests))
        spans = [Span(address, 1, function)] * n_requests
        try:
            async with client.connected():
                for _ in range(_TRIES_IN_FLIGHT):
                    await client.read_spans(spans)
        except AcquisitionError:
            break
        n_taken = n_requests
    return n_taken
