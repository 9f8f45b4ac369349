"""Messages of the confined child: short JSON heads and plain bytes, never pickled objects."""

import itertools
import json
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, NonNegativeInt, ValidationError

from acquisition.delivery.blocks import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import SampleType
from core.arrays import RawArray
from core.samples.blocks import Rejection, SampleBlock, SideValues
from core.samples.calibration import UnitCalibration

READY = b"\n"
"""First byte of a child that can take requests."""

FAILED = 3
"""Exit code of a child after an exception that a file has caused."""

MAX_HEAD_BYTES = 2**22
MAX_BODY_BYTES = 2**26
MAX_DATA = 64
"""Bytes of a CAN FD frame."""

HEAD_NUMBERS = ("epoch", "first_index", "start_ns", "n_samples", "ok")

Message = tuple[dict[str, Any], bytes]

Frames = npt.NDArray[np.void]
"""(n,) of `FRAME`, in the order of the log, without error frames and remote requests."""

Rejected = tuple[int, str, int]
"""Row of the block, reason, number of samples."""


def send(stream: BinaryIO, head: dict[str, Any], body: bytes = b"") -> None:
    """Write one message."""
    text = json.dumps(head, ensure_ascii=False).encode("utf-8", "surrogatepass")
    stream.write(len(text).to_bytes(4, "little") + len(body).to_bytes(4, "little") + text + body)


def receive(stream: BinaryIO) -> Message:
    """Read one message.

    Raises
    ------
    ConfigError
        If it is malformed or too long.
    EOFError
        If the stream ends within it.
    """
    lengths = _read(stream, 8)
    n_head, n_body = (int.from_bytes(lengths[at : at + 4], "little") for at in (0, 4))
    if n_head > MAX_HEAD_BYTES or n_body > MAX_BODY_BYTES:
        raise ConfigError(f"a message of {n_head} + {n_body} bytes from the reading process")
    try:
        head = json.loads(_read(stream, n_head))
    except (ValueError, RecursionError) as error:
        raise _malformed() from error
    if not isinstance(head, dict):
        raise _malformed()
    return head, _read(stream, n_body)


def _read(stream: BinaryIO, n_bytes: int) -> bytes:
    found = stream.read(n_bytes)
    if len(found) < n_bytes:
        raise EOFError
    return found


@dataclass(frozen=True)
class BlockHead:
    """A recorded block without its samples; see :class:`acquisition.delivery.blocks.RawBlock`."""

    epoch: int
    first_index: int
    start_ns: int
    n_samples: int
    ok: tuple[bool, ...]
    slow: tuple[float, ...]
    rejected: tuple[Rejection, ...]


def head_type(n_slow: int) -> np.dtype[np.void]:
    """Fields of a block head on the pipe; ``ok`` has a bit for each channel, channel 0 lowest."""
    return np.dtype([*((name, "<i8") for name in HEAD_NUMBERS), ("slow", "<f8", (n_slow,))])


def blocks_message(
    heads: npt.NDArray[np.void],
    rejected: Sequence[Rejected] = (),
    counts: RawArray | None = None,
    done: float = 0.0,
) -> Message:
    """Consecutive blocks as a message.

    Parameters
    ----------
    heads
        (n_blocks,) of :func:`head_type`.
    counts
        (n_channels, n_samples) of all blocks together; None for heads only.
    done
        Share of the file that has been read.
    """
    head = {"kind": "blocks", "done": done, "n": len(heads), "rejected": rejected}
    if counts is None:
        return head, heads.tobytes()
    return head | {"sample_type": counts.dtype.name}, heads.tobytes() + counts.tobytes()


def block_message(block: RawBlock, done: float) -> Message:
    """A block as a message."""
    row = np.zeros(1, head_type(len(block.slow)))
    ok = sum(is_ok << n for n, is_ok in enumerate(block.ok))
    row[0] = (block.epoch, block.first_index, block.start_ns, block.n_samples, ok, block.slow)
    return blocks_message(row, (), block.counts, done)


@dataclass(frozen=True)
class BlockLayout:
    """Shape of the blocks that a child sends, and the types that their samples may have."""

    calibration: UnitCalibration
    sample_types: tuple[str, ...] = ("int16", "float32")

    def heads(self, message: Message) -> list[BlockHead]:
        """Heads of the blocks of a message.

        Raises
        ------
        ConfigError
            If the message is not one of blocks of this layout.
        """
        rows, rejected, _ = self.parts(message)
        n_channels = len(self.calibration.channels)
        numbers, ok_bits = rows[list(HEAD_NUMBERS[:-1])].tolist(), rows["ok"].tolist()
        return [
            BlockHead(
                *(epoch, first_index, start_ns, n_samples),
                tuple(bool(ok >> n & 1) for n in range(max(n_channels, ok.bit_length()))),
                tuple(slow),
                tuple(rejected[row]),
            )
            for row, ((epoch, first_index, start_ns, n_samples), ok, slow) in enumerate(
                zip(numbers, ok_bits, rows["slow"].tolist(), strict=True)
            )
        ]

    def runs(self, message: Message) -> Iterator[SampleBlock]:
        """Blocks of a message with their samples, those that follow each other as one.

        Raises
        ------
        ConfigError
            As :meth:`heads`, and if the samples are not those of the heads.
        """
        rows, rejected, sample_type = self.parts(message)
        n_channels, n_samples = len(self.calibration.channels), rows["n_samples"]
        is_possible = ((n_samples > 0) & (n_samples <= len(message[1]))).all()
        if sample_type not in self.sample_types or not is_possible:
            raise _malformed()
        samples: RawArray = np.frombuffer(message[1], sample_type, offset=rows.nbytes)
        if len(samples) != n_channels * int(n_samples.sum()):
            raise _malformed()
        samples, stops = samples.reshape(n_channels, -1), np.cumsum(n_samples)
        begins = ~follows(rows, rejected)
        is_ok = (rows["ok"] >> np.arange(n_channels)[:, np.newaxis] & 1).astype(np.bool_)
        for first, stop in itertools.pairwise([*np.flatnonzero(begins).tolist(), len(rows)]):
            start, cells = int(stops[first] - n_samples[first]), slice(first, stop)
            yield SampleBlock(
                calibration=self.calibration,
                epoch=int(rows["epoch"][first]),
                first_index=int(rows["first_index"][first]),
                counts=samples[:, start : int(stops[stop - 1])],
                side=SideValues(
                    starts=stops[cells] - n_samples[cells] - start,
                    start_ns=rows["start_ns"][cells],
                    ok=is_ok[:, cells],
                    slow=rows["slow"][cells].T,
                ),
                rejected=tuple(rejected[first]),
            )

    def parts(
        self, message: Message
    ) -> tuple[npt.NDArray[np.void], Mapping[int, list[Rejection]], SampleType | None]:
        """Heads as (n_blocks,) of `head_type`, rejections by row, and the type of the samples."""
        try:
            head = _BlocksHead.model_validate(message[0])
        except ValidationError as error:
            raise _malformed() from error
        type_ = head_type(len(self.calibration.slow))
        if head.n * type_.itemsize > len(message[1]):
            raise _malformed()
        rejected = defaultdict(list)
        for row, reason, n_rejected in head.rejected:
            if not 0 <= row < head.n:
                raise _malformed()
            rejected[row].append(Rejection(reason, n_rejected))
        return np.frombuffer(message[1], type_, head.n), rejected, head.sample_type


def follows(
    rows: npt.NDArray[np.void], rejected: Mapping[int, list[Rejection]]
) -> npt.NDArray[np.bool_]:
    """Which blocks follow the one before in the same message, nothing missing or rejected."""
    found = np.zeros(len(rows), dtype=np.bool_)
    found[1:] = rows["epoch"][1:] == rows["epoch"][:-1]
    found[1:] &= rows["first_index"][1:] == (rows["first_index"] + rows["n_samples"])[:-1]
    found[list(rejected)] = False
    return found


class _BlocksHead(BaseModel):
    n: NonNegativeInt
    rejected: list[Rejected]
    sample_type: SampleType | None = None


FRAME = np.dtype(
    [
        ("time_ns", "<i8"),
        ("id", "<u4"),
        ("extended", "?"),
        ("fd", "?"),
        ("length", "u1"),
        ("data", "u1", (MAX_DATA,)),
    ]
)
"""A CAN data frame: time in UTC, id without flags and whether it has 29 bits, CAN FD or classic,
length of the data; the data are zero behind that."""


def frames_message(frames: Frames, done: float) -> Message:
    """Frames as a message; `done` is the share of the file that has been read."""
    return {"kind": "frames", "done": done}, frames.tobytes()


def frames_of(message: Message) -> Frames:
    """The frames of a message.

    Raises
    ------
    ConfigError
        If it is malformed.
    """
    if len(message[1]) % FRAME.itemsize:
        raise _malformed()
    return np.frombuffer(message[1], FRAME)


def _malformed() -> ConfigError:
    return ConfigError("a malformed message from the reading process")
