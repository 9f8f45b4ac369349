"""Block-ring profile: how a DAQ lays a ring of sample slots out in Modbus registers.

Register addresses are counted from the header's base, everything is big-endian::

    +0 magic        +1 version      +2 n_channels   +3 samples_per_slot  +4 n_slots
    +5..6 rate mHz  +7..8 epoch     +9..10 newest   +11 n_slow           +12 ring address
    +13 slot stride +14..15 CRC-32 of +0 to +13     +16... slow values, float32

    slot: sequence u32, first sample u32, seconds u32, microseconds u32, channel OK bits u32,
          epoch u32, slow values float32,
          int16 samples channel by channel, low word of the sequence again,
          CRC-32 of all before it

The version is 2. The slow values behind the header are there for simple clients, and not used here.
The CRC-32 is that of IEEE 802.3, as `zlib.crc32` has it, over the registers as bytes on the wire.
"""

import struct
import zlib
from dataclasses import dataclass

from acquisition.errors import ConfigError, FrameError
from acquisition.modbus.ring_layout import RingLayout

MAGIC = 0x5057
VERSION = 2
HEADER_REGISTERS = 16

_HEADER = struct.Struct(">5H3I3H")


@dataclass(frozen=True)
class RingHeader:
    """The head of the ring: its layout and how far the device has come."""

    layout: RingLayout
    epoch: int
    newest: int


def encode_header(header: RingHeader) -> bytes:
    """Header registers, without the slow values."""
    ring = header.layout
    data = _HEADER.pack(
        *(MAGIC, VERSION, ring.n_channels, ring.samples_per_slot, ring.n_slots),
        *(ring.rate_mhz, header.epoch, header.newest),
        *(ring.n_slow, ring.ring_address, ring.slot_stride),
    )
    return data + zlib.crc32(data).to_bytes(4, "big")


def decode_header(data: bytes) -> RingHeader:
    """Read the first 16 registers of a device.

    Raises
    ------
    ConfigError
        If this is not a block ring of this version, or one that cannot exist.
    FrameError
        If its checksum says that it was changed on the way or while it was written.
    """
    magic, version, n_channels, samples_per_slot, n_slots, rate_mhz, *rest = _HEADER.unpack_from(
        data
    )
    epoch, newest, n_slow, ring_address, slot_stride = rest
    if magic != MAGIC:
        raise ConfigError(f"block ring: magic is {magic:#06x}, expected {MAGIC:#06x}")
    if version != VERSION:
        raise ConfigError(f"block ring: profile version is {version}, known is {VERSION}")
    found = int.from_bytes(data[_HEADER.size : 2 * HEADER_REGISTERS], "big")
    expected = zlib.crc32(data[: _HEADER.size])
    if found != expected:
        raise FrameError(f"block ring: checksum of the header is {found:#x}, not {expected:#x}")
    layout = RingLayout(
        n_channels, samples_per_slot, n_slots, rate_mhz, n_slow, ring_address, slot_stride
    )
    layout.require_possible()
    return RingHeader(layout, epoch, newest)
