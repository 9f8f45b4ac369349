"""Messages of the confined child: short JSON heads and plain bytes, never pickled objects."""

import json
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, NonNegativeInt, ValidationError

from acquisition.delivery.calibration import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import SampleType
from core.arrays import RawArray
from core.samples.blocks import Rejection

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


def receive(read: Callable[[int], bytes]) -> Message:
    """Read one message.

    Parameters
    ----------
    read
        Returns exactly this many bytes.

    Raises
    ------
    ConfigError
        If it is malformed or too long.
    """
    lengths = read(8)
    n_head, n_body = (int.from_bytes(lengths[at : at + 4], "little") for at in (0, 4))
    if n_head > MAX_HEAD_BYTES or n_body > MAX_BODY_BYTES:
        raise ConfigError(f"a message of {n_head} + {n_body} bytes from the reading process")
    try:
        head = json.loads(read(n_head))
    except (ValueError, RecursionError) as error:
        raise _malformed() from error
    if not isinstance(head, dict):
        raise _malformed()
    return head, read(n_body)


@dataclass(frozen=True)
class BlockHead:
    """A recorded block without its samples; see :class:`acquisition.delivery.raw.RawBlock`."""

    epoch: int
    first_index: int
    start_ns: int
    n_samples: int
    ok: tuple[bool, ...]
    slow: tuple[float, ...]
    rejected: tuple[Rejection, ...]

    def raw(self, rate_hz: float, counts: RawArray) -> RawBlock:
        """The whole block."""
        return RawBlock(
            epoch=self.epoch,
            first_index=self.first_index,
            start_ns=self.start_ns,
            rate_hz=rate_hz,
            counts=counts,
            ok=self.ok,
            slow=self.slow,
            rejected=self.rejected,
        )


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

    n_channels: int
    n_slow: int
    sample_types: tuple[str, ...] = ("int16", "float32")

    def heads(self, message: Message) -> tuple[list[BlockHead], bytes]:
        """Heads of the blocks of a message, and the bytes behind them.

        Raises
        ------
        ConfigError
            If the message is not one of blocks of this layout.
        """
        head, body, type_ = _blocks_head(message), message[1], head_type(self.n_slow)
        n_bytes = head.n * type_.itemsize
        if n_bytes > len(body):
            raise _malformed()
        rejected = defaultdict(list)
        for row, reason, n_rejected in head.rejected:
            rejected[row].append(Rejection(reason, n_rejected))
        rows = np.frombuffer(body, type_, head.n)
        numbers = zip(rows[list(HEAD_NUMBERS)].tolist(), rows["slow"].tolist(), strict=True)
        heads = [
            BlockHead(
                epoch,
                first_index,
                start_ns,
                n_samples,
                tuple(bool(ok >> n & 1) for n in range(max(self.n_channels, ok.bit_length()))),
                tuple(slow),
                tuple(rejected[row]),
            )
            for row, ((epoch, first_index, start_ns, n_samples, ok), slow) in enumerate(numbers)
        ]
        return heads, body[n_bytes:]

    def blocks(self, message: Message) -> Iterator[tuple[BlockHead, RawArray]]:
        """Blocks of a message with their samples, (n_channels, n_samples).

        Raises
        ------
        ConfigError
            As :meth:`heads`, and if the samples are not those of the heads.
        """
        heads, body = self.heads(message)
        sample_type, n_samples = _blocks_head(message).sample_type, [h.n_samples for h in heads]
        n_bytes = np.dtype(sample_type).itemsize * self.n_channels * sum(n_samples)
        is_possible = sample_type in self.sample_types and min(n_samples, default=0) > 0
        if not is_possible or len(body) != n_bytes:
            raise _malformed()
        counts: RawArray = np.frombuffer(body, dtype=sample_type).reshape(self.n_channels, -1)
        stop = 0
        for head in heads:
            start, stop = stop, stop + head.n_samples
            yield head, counts[:, start:stop]


class _BlocksHead(BaseModel):
    n: NonNegativeInt
    rejected: list[Rejected]
    sample_type: SampleType | None = None


def _blocks_head(message: Message) -> _BlocksHead:
    try:
        return _BlocksHead.model_validate(message[0])
    except ValidationError as error:
        raise _malformed() from error


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
