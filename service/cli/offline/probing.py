"""Reading a Modbus device once, value by value, against its settings."""

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace

from acquisition.errors import AcquisitionError
from acquisition.modbus.cells import N_BYTES, ByteOrder, Cell, NumberType
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.decoding import MapDecoder, byte_permutation
from acquisition.modbus.identity import Identification
from acquisition.modbus.polled_source import MapReader
from acquisition.modbus.register_map import MapValue, RegisterMap
from acquisition.modbus.requests import Span
from acquisition.modbus.ring_follower import RingReader
from acquisition.modbus.ring_profile import RingHeader, Slot
from acquisition.modbus.transport import LinkSettings
from service.settings.adapter_values import link_fields
from service.settings.sources.modbus import ModbusLinkSettings

PLAUSIBLE = (1e-3, 1e6)
"""Absolute values of a float that a machine may have; anything else is likely another type or byte
order. Exact zero is neither."""

FORMATS = {
    NumberType.INT16: ">h",
    NumberType.UINT16: ">H",
    NumberType.INT32: ">i",
    NumberType.UINT32: ">I",
    NumberType.FLOAT32: ">f",
}
PAIR_TYPES = (NumberType.INT32, NumberType.UINT32, NumberType.FLOAT32)


@dataclass(frozen=True)
class RegisterLook:
    """One register and what it may be.

    Parameters
    ----------
    singles
        int16 and uint16, bytes as they come and exchanged, by name.
    pairs
        With the next register: each type in each byte order; empty for the last one.
    plausible
        Byte orders in which the pair is a float that a machine may have.
    """

    address: int
    raw: int
    singles: dict[str, int]
    pairs: dict[str, dict[str, float | int | None]]
    plausible: tuple[str, ...]


@dataclass(frozen=True)
class ValueLook:
    """One value of a map.

    Parameters
    ----------
    registers
        Raw words of its own number; a single bit of functions 1 and 2 is 0 or 1.
    flags
        Status registers that speak of it, by address.
    """

    id: str
    address: int
    function: int
    registers: tuple[int, ...]
    value: float | None
    state: str
    flags: dict[int, int]


@dataclass(frozen=True)
class RingChannelLook:
    """Counts of one channel in the newest slot of a block ring, and the device's verdict on it."""

    channel: int
    ok: bool
    minimum: int
    mean: float
    maximum: int


@dataclass(frozen=True)
class RingLook:
    """A block ring as it was found.

    Parameters
    ----------
    state
        Of the newest slot: "whole", "torn" (it was being written), "damaged" (its checksum is
        wrong) or "blank" (nothing was written there since the device started).
    start_ns
        Time of its first sample by the device, UTC nanoseconds since 1970.
    slow
        Its slow values; None where there is none.
    """

    n_channels: int
    rate_hz: float
    samples_per_slot: int
    n_slots: int
    epoch: int
    newest: int
    state: str
    first_index: int
    start_ns: int
    slow: tuple[float | None, ...]
    channels: tuple[RingChannelLook, ...]


def ring_look(header: RingHeader, slot: Slot) -> RingLook:
    """Show a block ring by its header and its newest slot."""
    ring = header.layout
    state = (
        "blank" if slot.blank else "torn" if slot.torn else "damaged" if slot.damage else "whole"
    )
    return RingLook(
        n_channels=ring.n_channels,
        rate_hz=ring.rate_mhz / 1000.0,
        samples_per_slot=ring.samples_per_slot,
        n_slots=ring.n_slots,
        epoch=header.epoch,
        newest=header.newest,
        state=state,
        first_index=slot.first_index,
        start_ns=slot.start_ns,
        slow=tuple(value if math.isfinite(value) else None for value in slot.slow),
        channels=tuple(
            RingChannelLook(
                channel=number,
                ok=bool(slot.ok_bits >> number & 1),
                minimum=int(counts.min()),
                mean=float(counts.mean()),
                maximum=int(counts.max()),
            )
            for number, counts in enumerate(slot.counts)
        ),
    )


def looks(data: bytes, address: int) -> list[RegisterLook]:
    """Read each register in every way.

    Parameters
    ----------
    data
        Big-endian words.
    address
        Of the first one.
    """
    return [_look(data[2 * n : 2 * n + 4], address + n) for n in range(len(data) // 2)]


def value_looks(decoder: MapDecoder, content: bytes) -> list[ValueLook]:
    """Show every value of a map with the registers that it came from."""
    reading = decoder.read(content)
    return [
        ValueLook(
            id=value.id,
            address=value.cell.address,
            function=value.cell.function,
            registers=_words(decoder, content, value.cell),
            value=float(number) if math.isfinite(number) else None,
            state=state.name.lower(),
            flags=dict(_flags(decoder, content, value)),
        )
        for value, number, state in zip(
            decoder.map.values, reading.values, reading.states, strict=True
        )
    ]


def _look(data: bytes, address: int) -> RegisterLook:
    singles = {
        f"{type_} {order.pair}": int(_number(data[:2], type_, order))
        for order in (ByteOrder.ABCD, ByteOrder.BADC)
        for type_ in (NumberType.INT16, NumberType.UINT16)
    }
    pairs: dict[str, dict[str, float | int | None]] = {}
    plausible: tuple[str, ...] = ()
    if len(data) == N_BYTES[NumberType.FLOAT32]:
        pairs = {
            type_.value: {order.value: _shown(_number(data, type_, order)) for order in ByteOrder}
            for type_ in PAIR_TYPES
        }
        floats = pairs[NumberType.FLOAT32.value]
        plausible = tuple(order for order, number in floats.items() if _is_plausible(number))
    return RegisterLook(address, int.from_bytes(data[:2], "big"), singles, pairs, plausible)


def _number(data: bytes, type_: NumberType, order: ByteOrder) -> float:
    straight = bytes(data[place] for place in byte_permutation(type_, order))
    number: float = struct.unpack(FORMATS[type_], straight)[0]
    return number


def _shown(number: float) -> float | int | None:
    return number if math.isfinite(number) else None


def _is_plausible(number: float | None) -> bool:
    return number is not None and PLAUSIBLE[0] <= abs(number) <= PLAUSIBLE[1]


def _words(decoder: MapDecoder, content: bytes, cell: Cell) -> tuple[int, ...]:
    start, bit = decoder.plan.place_of(cell)
    if cell.function in (1, 2):
        return (content[start] >> bit & 1,)
    return struct.unpack_from(f">{cell.n_places}H", content, start)


def _flags(decoder: MapDecoder, content: bytes, value: MapValue) -> Iterator[tuple[int, int]]:
    for flag in value.flags:
        yield flag.cell.address, _words(decoder, content, flag.cell)[0]


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
