"""Lossless encoding and decoding of blocks and link states as stream messages."""

import hashlib
import itertools
import json
import math
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import lru_cache
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from pydantic import ConfigDict, Field, TypeAdapter, ValidationError

from core.quality import Reading
from core.samples.blocks import DeviceClock, Rejection, SampleBlock, SideValues, StampFault
from core.samples.calibration import UnitCalibration
from service.measuring.acquirer import LinkNews

SENDER = "check which program writes to the stream"


class WireError(ValueError):
    """Error raised if a stream message cannot be used; another attempt would also fail.

    ``kind`` is a short code of the reason, used as a label of metrics.
    """

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind


def require_possible(block: SampleBlock) -> None:
    """Raise `WireError` if a decoded block has content that no adapter produces.

    Such content is: no samples, a calibration or slow value that is not finite, or a negative
    number of rejected samples.
    """
    if not block.n_samples:
        raise WireError("impossible", f"a block without samples; {SENDER}")
    if not all(math.isfinite(c.unit_per_count) for c in block.calibration.channels):
        raise WireError("impossible", f"a block with a calibration that is not finite; {SENDER}")
    if not all(math.isfinite(reading.value or 0.0) for reading in block.slow.values()):
        raise WireError("impossible", f"a block with a slow value that is not finite; {SENDER}")
    if any(rejection.n_samples < 0 for rejection in block.rejected):
        raise WireError(
            "impossible", f"a block with a negative number of rejected samples; {SENDER}"
        )


FINGERPRINT_BYTES = 16


@dataclass(frozen=True)
class UnitIdentity:
    """Identity of a unit, which every stream message of the unit contains.

    Parameters
    ----------
    plant
        Hash of the name of the plant.
    make
        Fingerprint of unit id, rate, kind of source, and channels; a message with a different
        fingerprint is refused, since its samples would be misinterpreted.
    """

    unit: str
    plant: bytes
    make: bytes


def fingerprint(*words: object) -> bytes:
    """Return the first 16 bytes of the SHA-256 hash of the JSON text of the arguments."""
    text = json.dumps(words, ensure_ascii=True, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).digest()[:FINGERPRINT_BYTES]


MAGIC = b"PWSM"

VERSION = 2
MAX_HEAD_BYTES = 1 << 18
MAX_SAMPLE_BYTES = 1 << 26

_START = struct.Struct(f"<4sHH{FINGERPRINT_BYTES}s{FINGERPRINT_BYTES}sII")
_CRC = struct.Struct("<I")


class Kind(IntEnum):
    """Kind of a stream message: block or link state."""

    BLOCK = 1
    LINK = 2


def framed(kind: Kind, identity: UnitIdentity, head: bytes, samples: bytes = b"") -> bytes:
    """Return a stream message; raise `ValueError` if its JSON head or its samples are too large."""
    if len(head) > MAX_HEAD_BYTES or len(samples) > MAX_SAMPLE_BYTES:
        raise ValueError(
            f"a message has at most {MAX_HEAD_BYTES} bytes of head and {MAX_SAMPLE_BYTES} of"
            f" samples, got {len(head)} and {len(samples)}"
        )
    start = _START.pack(
        MAGIC, VERSION, kind, identity.plant, identity.make, len(head), len(samples)
    )
    body = b"".join((start, head, samples))
    return body + _CRC.pack(zlib.crc32(body))


def _unframed(message: bytes, identity: UnitIdentity) -> tuple[Kind, bytes, memoryview]:
    """Check a stream message of the unit `identity`; return its kind, head and samples.

    Raises `WireError` if the bytes are not a message, are damaged, or are of another version, plant
    or configuration. Invalid bytes raise no other exception.
    """
    if len(message) < _START.size + _CRC.size or message[:4] != MAGIC:
        raise WireError(
            "not_a_message", f"{len(message)} bytes that are not a padwatch message; {SENDER}"
        )
    _, version, kind, plant, make, n_head, n_samples = _START.unpack_from(message)
    if version != VERSION:
        newer = "upgrade `padwatch analyse`" if version > VERSION else "upgrade `padwatch acquire`"
        words = (
            f"a message of format version {version}, but this program supports {VERSION}; {newer}"
        )
        raise WireError("other_version", words)
    whole = _START.size + n_head + n_samples + _CRC.size
    if n_head > MAX_HEAD_BYTES or n_samples > MAX_SAMPLE_BYTES or whole != len(message):
        why = f"a message of {len(message)} bytes, expected {whole}; {SENDER}"
        raise WireError("wrong_length", why)
    (crc,) = _CRC.unpack_from(message, whole - _CRC.size)
    body = memoryview(message)
    if crc != zlib.crc32(body[: whole - _CRC.size]):
        raise WireError("damaged", "a message with a wrong checksum; check the servers' disks")
    if plant != identity.plant:
        raise WireError("other_plant", "a message of another plant; use one stream for each plant")
    if make != identity.make:
        raise WireError(
            "other_configuration",
            f"channels or rate of a block of {identity.unit} differ from the plant file; use"
            " the same plant file for acquire and analyse",
        )
    if kind not in Kind.__members__.values():
        raise WireError("unknown_kind", f"a message of unknown kind {kind}; {SENDER}")
    head = bytes(body[_START.size : _START.size + n_head])
    samples = body[_START.size + n_head : whole - _CRC.size]
    return Kind(kind), head, samples


SAMPLE: Mapping[str, np.dtype[Any]] = {"int16": np.dtype("<i2"), "float32": np.dtype("<f4")}
"""Encoding of samples by type: converter counts as int16, engineering units as float32."""

Epoch = Annotated[int, Field(ge=0, lt=2**63)]
Index = Annotated[int, Field(ge=0, lt=2**53)]
"""Sample index below 2**53, which a double represents exactly, as recordings require."""

Ns = Annotated[int, Field(ge=-(2**62), lt=2**62)]
"""Time in ns, from 1823 to 2116, so that sums and differences fit 64-bit database columns."""

STRICT = ConfigDict(extra="forbid", ser_json_inf_nan="constants")


class Cell(NamedTuple):
    """Values that apply from the sample with index ``start`` on.

    They are the time in ns since 1970 UTC, a bit mask ``ok`` of good channels, and slow values.
    """

    start: Index
    start_ns: Ns
    ok: Index
    slow: tuple[float, ...]


@dataclass(frozen=True)
class _BlockHead:
    """JSON head of a block message: all fields of a block but its samples, and `taken_ns`."""

    __pydantic_config__ = STRICT

    calibration: UnitCalibration
    epoch: Epoch
    first_index: Index
    n_samples: Index
    sample_type: Literal["int16", "float32"]
    cells: tuple[Cell, ...]
    elsewhere: dict[str, Reading]
    rejected: tuple[Rejection, ...]
    clock: DeviceClock | None
    stamp_fault: StampFault | None
    taken_ns: Ns


_BLOCK, _LINK = TypeAdapter(_BlockHead), TypeAdapter(LinkNews)


@dataclass(frozen=True)
class Taken:
    """Decoded block with its time of acquisition.

    Parameters
    ----------
    taken_ns
        Time of the last sample by the clock of the acquiring host, ns since 1970 UTC; the delay of
        the analysis is measured from it.
    """

    block: SampleBlock
    taken_ns: int


def encoded_block(block: SampleBlock, identity: UnitIdentity, taken_ns: int) -> bytes:
    """Encode a block as a stream message; ``taken_ns`` is the host time of its last sample, ns.

    Raises `ValueError` if the block is too large for a message.
    """
    side, type_ = block.side, block.counts.dtype.name
    columns = (side.starts.tolist(), side.start_ns.tolist(), side.ok.T.tolist())
    head = _BlockHead(
        calibration=block.calibration,
        epoch=block.epoch,
        first_index=block.first_index,
        n_samples=block.n_samples,
        sample_type="int16" if type_ == "int16" else "float32",
        cells=tuple(
            Cell(start, start_ns, sum(is_ok << row for row, is_ok in enumerate(ok)), tuple(slow))
            for start, start_ns, ok, slow in zip(*columns, side.slow.T.tolist(), strict=True)
        ),
        elsewhere=dict(block.elsewhere),
        rejected=block.rejected,
        clock=block.clock,
        stamp_fault=block.stamp_fault,
        taken_ns=taken_ns,
    )
    samples = np.ascontiguousarray(block.counts, dtype=SAMPLE[head.sample_type]).tobytes()
    return framed(Kind.BLOCK, identity, _BLOCK.dump_json(head), samples)


def encoded_link(news: LinkNews, identity: UnitIdentity) -> bytes:
    """Encode a link state as a stream message; its reason is cut to 1000 characters."""
    head = replace(news, reason=None if news.reason is None else news.reason[:1000])
    return framed(Kind.LINK, identity, _LINK.dump_json(head))


def decoded(message: bytes, identity: UnitIdentity) -> Taken | LinkNews:
    """Decode a stream message of the unit `identity` to a block or a link state.

    Raises `WireError` if the message cannot be used. Invalid bytes raise no other exception.
    """
    kind, content, samples = _unframed(message, identity)
    try:
        head = (_LINK if kind is Kind.LINK else _BLOCK).validate_json(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        where = ".".join(str(part) for part in first["loc"])
        words = f"{where}: {first['msg']}" if where else first["msg"]
        why = f"a message with an invalid head: {words}; {SENDER}"
        raise WireError("not_understood", why) from None
    unit = head.unit if isinstance(head, LinkNews) else head.calibration.unit
    if unit != identity.unit:
        why = f"a message of unit {unit} on the subject of unit {identity.unit}; {SENDER}"
        raise WireError("other_unit", why)
    if isinstance(head, LinkNews):
        return head
    n_channels, type_ = len(head.calibration.channels), SAMPLE[head.sample_type]
    if n_channels * head.n_samples * type_.itemsize != len(samples):
        raise WireError(
            "wrong_length",
            f"{len(samples)} bytes for {n_channels} channels of {head.n_samples} samples; {SENDER}",
        )
    counts = np.frombuffer(samples, dtype=type_).reshape(n_channels, head.n_samples)
    block = SampleBlock(
        calibration=_shared(head.calibration),
        epoch=head.epoch,
        first_index=head.first_index,
        counts=counts.astype(head.sample_type, copy=False),
        side=_side_values(head),
        elsewhere=head.elsewhere,
        rejected=head.rejected,
        clock=head.clock,
        stamp_fault=head.stamp_fault,
    )
    return Taken(block, head.taken_ns)


@lru_cache(maxsize=1024)
def _shared(calibration: UnitCalibration) -> UnitCalibration:
    """Return the same object for equal calibrations, as the blocks of a local source share one."""
    return calibration


def _side_values(head: _BlockHead) -> SideValues:
    n_channels, n_slow = len(head.calibration.channels), len(head.calibration.slow)
    starts = [cell.start for cell in head.cells]
    edges = [*starts, max(head.n_samples, 1)]  # an empty block has one cell without samples
    if (
        starts[:1] != [0]
        or any(start >= stop for start, stop in itertools.pairwise(edges))
        or any(len(cell.slow) != n_slow or cell.ok >> n_channels for cell in head.cells)
    ):
        raise WireError("not_understood", f"a block with invalid times or slow values; {SENDER}")
    slow = np.array([cell.slow for cell in head.cells], dtype=np.float64)
    return SideValues(
        starts=np.array(starts, dtype=np.int64),
        start_ns=np.array([cell.start_ns for cell in head.cells], dtype=np.int64),
        ok=np.array([[bool(c.ok >> row & 1) for c in head.cells] for row in range(n_channels)]),
        slow=slow.reshape(len(starts), n_slow).T,
    )
