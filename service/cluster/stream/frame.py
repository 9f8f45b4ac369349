"""The frame of every message on a stream: who sent what, in which version, and whole.

Little-endian::

    0   magic "PWSM"          4 bytes
    4   version               u16
    6   kind                  u16   1 block, 2 news of a link
    8   plant fingerprint     16 bytes
    24  make fingerprint      16 bytes
    40  bytes of the head     u32   JSON, UTF-8
    44  bytes of the samples  u32
    48  head, then samples
    end CRC-32 of all before  u32
"""

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum

from service.cluster.stream.identity import FINGERPRINT_BYTES, UnitIdentity
from service.cluster.stream.wire_errors import WireError

MAGIC = b"PWSM"

VERSION = 1
READABLE = (1,)
"""A reader knows the version it writes and the one before: it is upgraded before the writers."""

MAX_HEAD_BYTES = 1 << 18
MAX_SAMPLE_BYTES = 1 << 26

_START = struct.Struct(f"<4sHH{FINGERPRINT_BYTES}s{FINGERPRINT_BYTES}sII")
_CRC = struct.Struct("<I")


class Kind(IntEnum):
    """What a message is."""

    BLOCK = 1
    LINK = 2


@dataclass(frozen=True)
class Frame:
    """A message taken apart, with nothing read of its head yet."""

    kind: Kind
    head: bytes
    samples: memoryview


def framed(kind: Kind, identity: UnitIdentity, head: bytes, samples: bytes = b"") -> bytes:
    """Put a message together.

    Raises
    ------
    ValueError
        If a part is longer than a reader takes.
    """
    if len(head) > MAX_HEAD_BYTES or len(samples) > MAX_SAMPLE_BYTES:
        raise ValueError(
            f"a message holds at most {MAX_HEAD_BYTES} bytes of head and {MAX_SAMPLE_BYTES} of"
            f" samples, not {len(head)} and {len(samples)}"
        )
    start = _START.pack(
        MAGIC, VERSION, kind, identity.plant, identity.make, len(head), len(samples)
    )
    body = b"".join((start, head, samples))
    return body + _CRC.pack(zlib.crc32(body))


def unframed(message: bytes, identity: UnitIdentity) -> Frame:
    """Take a message apart.

    Raises
    ------
    WireError
        If it is no message, damaged, of another version, plant or configuration; never anything
        else, whatever the bytes are.
    """
    if len(message) < _START.size + _CRC.size or message[:4] != MAGIC:
        raise WireError("not_a_message", f"{len(message)} bytes that are no message of padwatch")
    _, version, kind, plant, make, n_head, n_samples = _START.unpack_from(message)
    if version not in READABLE:
        raise WireError("other_version", _other_version(version))
    whole = _START.size + n_head + n_samples + _CRC.size
    if n_head > MAX_HEAD_BYTES or n_samples > MAX_SAMPLE_BYTES or whole != len(message):
        raise WireError("wrong_length", f"a message of {len(message)} bytes that claims {whole}")
    (crc,) = _CRC.unpack_from(message, whole - _CRC.size)
    body = memoryview(message)
    if crc != zlib.crc32(body[: whole - _CRC.size]):
        raise WireError("damaged", "a message whose checksum does not fit it")
    if plant != identity.plant:
        raise WireError("other_plant", "a message of another plant: give each its own stream")
    if make != identity.make:
        raise WireError(
            "other_configuration",
            f"a block of {identity.unit} made with other channels or another rate: let acquire and"
            " analyse use the same plant file",
        )
    if kind not in Kind.__members__.values():
        raise WireError("unknown_kind", f"a message of kind {kind}, which is not known")
    head = bytes(body[_START.size : _START.size + n_head])
    samples = body[_START.size + n_head : whole - _CRC.size]
    return Frame(Kind(kind), head, samples)


def _other_version(version: int) -> str:
    known = " and ".join(str(each) for each in READABLE)
    newer = "upgrade `padwatch analyse`" if version > VERSION else "upgrade `padwatch acquire`"
    return f"a message of format version {version}, this program reads {known}: {newer}"
