"""Messages of the confined child: short JSON heads and plain bytes, never pickled objects."""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO, Protocol

import can
import numpy as np
import numpy.typing as npt

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.manifest import MAX_BLOCK_SAMPLES
from core.arrays import RawArray
from core.samples.blocks import Rejection

MAX_HEAD_BYTES = 2**22
MAX_BODY_BYTES = 2**26
MAX_DATA = 64
"""Bytes of a CAN FD frame."""

HEAD_NUMBERS = ("epoch", "first_index", "start_ns", "n_samples", "ok")

Message = tuple[dict[str, Any], bytes]

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
        raise ConfigError("a malformed message from the reading process") from error
    if not isinstance(head, dict):
        raise ConfigError("a malformed message from the reading process")
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
    return head, heads.tobytes() + (b"" if counts is None else np.ascontiguousarray(counts).data)


def block_message(block: RawBlock, done: float) -> Message:
    """A block as a message."""
    row = np.zeros(1, head_type(len(block.slow)))
    ok = sum(is_ok << n for n, is_ok in enumerate(block.ok))
    row[0] = (block.epoch, block.first_index, block.start_ns, block.n_samples, ok, block.slow)
    return blocks_message(row, (), block.counts, done)


@dataclass(frozen=True)
class BlockLayout:
    """Shape of the blocks that a child sends."""

    n_channels: int
    n_slow: int
    sample_type: str

    def heads(self, message: Message) -> tuple[list[BlockHead], bytes]:
        """Heads of the blocks of a message, and the bytes behind them.

        Raises
        ------
        ConfigError
            If the message is not one of blocks of this layout.
        """
        head, body = message
        type_, n_blocks = head_type(self.n_slow), head.get("n")
        if type(n_blocks) is not int or not 0 <= n_blocks * type_.itemsize <= len(body):
            raise ConfigError("malformed blocks from the reading process")
        rejected = _rejections(head.get("rejected"), n_blocks)
        rows = np.frombuffer(body, type_, n_blocks)
        heads = [
            BlockHead(
                epoch,
                first_index,
                start_ns,
                n_samples,
                tuple(bool(ok >> n & 1) for n in range(max(self.n_channels, ok.bit_length()))),
                tuple(slow),
                tuple(rejections),
            )
            for (epoch, first_index, start_ns, n_samples, ok), slow, rejections in zip(
                rows[list(HEAD_NUMBERS)].tolist(), rows["slow"].tolist(), rejected, strict=True
            )
        ]
        return heads, body[n_blocks * type_.itemsize :]

    def blocks(self, message: Message) -> Iterator[tuple[BlockHead, RawArray]]:
        """Blocks of a message with their samples, (n_channels, n_samples) of `sample_type`.

        Raises
        ------
        ConfigError
            As :meth:`heads`, and if the samples are not those of the heads.
        """
        heads, body = self.heads(message)
        n_samples = [head.n_samples for head in heads]
        size = np.dtype(self.sample_type).itemsize * self.n_channels
        if not all(0 < n <= MAX_BLOCK_SAMPLES for n in n_samples) or len(body) != size * sum(
            n_samples
        ):
            raise ConfigError("malformed blocks from the reading process")
        counts: RawArray = np.frombuffer(body, self.sample_type).reshape(self.n_channels, -1)
        stop = 0
        for head in heads:
            start, stop = stop, stop + head.n_samples
            yield head, counts[:, start:stop]


def _rejections(rejected: object, n_blocks: int) -> list[list[Rejection]]:
    found: list[list[Rejection]] = [[] for _ in range(n_blocks)]
    try:
        for row, reason, n_samples in rejected:  # type: ignore[attr-defined]
            if type(n_samples) is not int or not isinstance(reason, str) or row < 0:
                raise ConfigError("malformed blocks from the reading process")
            found[row].append(Rejection(reason, n_samples))
    except (TypeError, ValueError, IndexError) as error:
        raise ConfigError("malformed blocks from the reading process") from error
    return found


@dataclass(frozen=True)
class FrameBatch:
    """Data frames in the order of the log; error frames and remote requests are left out.

    Parameters
    ----------
    times_ns
        (n,) int64, UTC.
    ids
        (n,) uint32 without flags.
    extended
        (n,) bool: whether the id has 29 bits.
    fd
        (n,) bool: whether it is a CAN FD frame.
    lengths
        (n,) uint8: bytes of data.
    data
        (n, 64) uint8, zero behind the length.
    """

    times_ns: npt.NDArray[np.int64]
    ids: npt.NDArray[np.uint32]
    extended: npt.NDArray[np.bool_]
    fd: npt.NDArray[np.bool_]
    lengths: npt.NDArray[np.uint8]
    data: npt.NDArray[np.uint8]

    def messages(self) -> Iterator[can.Message]:
        """The frames one by one."""
        data = self.data.tobytes()
        columns = (self.times_ns, self.ids, self.extended, self.fd, self.lengths)
        rows = zip(*(column.tolist() for column in columns), strict=True)
        for n, (time_ns, id_, extended, fd, length) in enumerate(rows):
            yield can.Message(
                timestamp=time_ns / 1e9,
                arbitration_id=id_,
                is_extended_id=extended,
                is_fd=fd,
                dlc=length,
                data=data[n * MAX_DATA : n * MAX_DATA + length],
            )


class FrameDecoder(Protocol):
    """Makes raw blocks of CAN frames by a DBC file."""

    def take(self, frames: FrameBatch) -> list[RawBlock]:
        """Decode the next frames of a log.

        Raises
        ------
        ConfigError
            If they cannot be those of the unit.
        """
        ...

    def flush(self) -> list[RawBlock]:
        """Blocks that are left at the end of the log."""
        ...


_FRAME = np.dtype(
    [
        ("times_ns", "<i8"),
        ("ids", "<u4"),
        ("extended", "?"),
        ("fd", "?"),
        ("lengths", "u1"),
        ("data", "u1", (MAX_DATA,)),
    ]
)


def frames_message(frames: FrameBatch, done: float) -> Message:
    """Frames as a message."""
    rows = np.zeros(len(frames.times_ns), _FRAME)
    for name, column in vars(frames).items():
        rows[name] = column
    return {"kind": "frames", "done": done}, rows.tobytes()


def frames_of(message: Message) -> FrameBatch:
    """The frames of a message.

    Raises
    ------
    ConfigError
        If it is not one of frames.
    """
    if len(message[1]) % _FRAME.itemsize:
        raise ConfigError("malformed frames from the reading process")
    rows = np.frombuffer(message[1], _FRAME)
    return FrameBatch(**{name: rows[name] for name in _FRAME.names or ()})
