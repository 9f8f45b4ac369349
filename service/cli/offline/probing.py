"""One-time reads of a Modbus device, decoded value by value.

Functions that read raise `LinkError` if the device does not answer or answers wrongly, and
`ConfigError` if it lacks the registers or is another device.
"""

import math
import struct
from dataclasses import dataclass, replace

from acquisition.errors import AcquisitionError
from acquisition.modbus.cells import N_BYTES, ByteOrder, Cell, NumberType
from acquisition.modbus.client import ModbusClient
from acquisition.modbus.decoding import MapDecoder, byte_permutation
from acquisition.modbus.polled_source import MapReader
from acquisition.modbus.register_map import RegisterMap
from acquisition.modbus.requests import Span
from acquisition.modbus.ring_follower import RingReader
from acquisition.modbus.ring_profile import RingHeader, Slot
from acquisition.modbus.transport import Identification, LinkSettings
from service.settings.adapter_values import link_settings
from service.settings.sources.modbus import ModbusLinkSettings

PLAUSIBLE = (1e-3, 1e6)
"""Plausible absolute values of a float; others indicate another type or byte order, except 0."""

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
    """Modbus register, decoded as every number type in every byte order.

    Parameters
    ----------
    singles
        Values as int16 and uint16 in both byte orders, by the name of type and order.
    pairs
        Values of this and the next register as 32-bit types, by type and byte order; None if not
        finite. Empty for the last register.
    plausible
        Byte orders in which this and the next register are a float32 of magnitude 1e-3 to 1e6.
    """

    address: int
    raw: int
    singles: dict[str, int]
    pairs: dict[str, dict[str, float | int | None]]
    plausible: tuple[str, ...]


@dataclass(frozen=True)
class ValueLook:
    """Value of a register map, None if it is not finite, with its raw registers.

    Parameters
    ----------
    state
        "ok"; "clipped"; "invalid" by the number itself; "flagged" as bad by a status register.
    registers
        Raw 16-bit registers of the value; for functions 1 and 2 a bit, 0 or 1.
    flags
        Status registers of the value, by address.
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
    """Counts of a channel in the newest slot of a block ring, and the state of its transducer.

    `channel` counts from 0; `ok` is the bit by which the device reports a healthy transducer.
    """

    channel: int
    ok: bool
    minimum: int
    mean: float
    maximum: int


@dataclass(frozen=True)
class RingLook:
    """Layout of a block ring, the ring buffer of a Modbus device, and its newest slot.

    Parameters
    ----------
    state
        State of the newest slot: "whole", "torn" (being written), "damaged" (wrong checksum) or
        "blank" (not written since the device started).
    start_ns
        Device time of the first sample, ns since 1970 UTC.
    slow
        Slow values; None for a value that is not finite.
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
    """Return the layout of a block ring and the content of its newest slot."""
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
        slow=tuple(map(_finite, slot.slow)),
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
    """Decode the 16-bit big-endian registers `data`, from `address` on, as every number type."""
    return [_look(data[2 * n : 2 * n + 4], address + n) for n in range(len(data) // 2)]


def value_looks(decoder: MapDecoder, content: bytes) -> list[ValueLook]:
    """Return every value of a register map, decoded from the registers `content`."""
    reading = decoder.read(content)
    return [
        ValueLook(
            id=value.id,
            address=value.cell.address,
            function=value.cell.function,
            registers=_words(decoder, content, value.cell),
            value=_finite(float(number)),
            state=state.name.lower(),
            flags={f.cell.address: _words(decoder, content, f.cell)[0] for f in value.flags},
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
            type_.value: {order.value: _finite(_number(data, type_, order)) for order in ByteOrder}
            for type_ in PAIR_TYPES
        }
        floats = pairs[NumberType.FLOAT32.value]
        low, high = PLAUSIBLE
        plausible = tuple(o for o, x in floats.items() if x is not None and low <= abs(x) <= high)
    return RegisterLook(address, int.from_bytes(data[:2], "big"), singles, pairs, plausible)


def _number(data: bytes, type_: NumberType, order: ByteOrder) -> float:
    straight = bytes(data[place] for place in byte_permutation(type_, order))
    number: float = struct.unpack(FORMATS[type_], straight)[0]
    return number


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _words(decoder: MapDecoder, content: bytes, cell: Cell) -> tuple[int, ...]:
    start, bit = decoder.plan.place_of(cell)
    if cell.function in (1, 2):
        return (content[start] >> bit & 1,)
    return struct.unpack_from(f">{cell.n_places}H", content, start)


_TRIES_IN_FLIGHT = 20


async def read_once(device: ModbusLinkSettings, function: int, address: int, count: int) -> bytes:
    """Read `count` registers as 16-bit big-endian words; for functions 1 and 2 bits, 8 per byte.

    Raises `LinkError` or `ConfigError` if the device does not answer or refuses the request.
    """
    client = ModbusClient(link_settings(LinkSettings, device))
    async with client.connected():
        return await client.read(address, count, function)


async def read_map_once(
    device: ModbusLinkSettings, registers: RegisterMap
) -> tuple[MapDecoder, bytes]:
    """Check a device against a register map; return the map's decoder and the registers read.

    Raises `LinkError` or `ConfigError` if the device does not answer, or does not match the map.
    """
    decoder = MapDecoder(registers)
    reader = MapReader(link_settings(LinkSettings, device), decoder)
    async with reader.connected():
        return decoder, await reader.content()


async def read_ring_once(
    device: ModbusLinkSettings, base_address: int, function: int
) -> tuple[RingHeader, Slot]:
    """Read the header and the newest slot of a block ring; `base_address` is that of the header.

    Raises `LinkError` or `ConfigError` if the device does not answer, or has no block ring there.
    """
    client = ModbusClient(link_settings(LinkSettings, device))
    reader = RingReader(client, base_address, function)
    async with client.connected():
        header = await reader.header()
        [slot] = await reader.slots(header.layout, [header.newest])
        return header, slot


async def identify_once(device: ModbusLinkSettings) -> Identification:
    """Read the vendor, product code and revision of a device (function 43/14).

    Raises `LinkError` or `ConfigError` if the device does not answer or refuses the request.
    """
    client = ModbusClient(link_settings(LinkSettings, device))
    async with client.connected():
        return await client.identify()


async def measure_in_flight(
    device: ModbusLinkSettings, address: int, function: int, most: int
) -> int:
    """Return how many simultaneous requests of one register a device answers, 1 to `most`.

    Raises `LinkError` or `ConfigError` if the device does not answer a single request.
    """
    await read_once(device, function, address, 1)
    n_answered = 1
    for n_requests in range(2, most + 1):
        client = ModbusClient(
            replace(link_settings(LinkSettings, device), requests_in_flight=n_requests)
        )
        spans = [Span(address, 1, function)] * n_requests
        try:
            async with client.connected():
                for _ in range(_TRIES_IN_FLIGHT):
                    await client.read_spans(spans)
        except AcquisitionError:
            break
        n_answered = n_requests
    return n_answered
