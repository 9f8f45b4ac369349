"""Messages from the confined child process: a short JSON header and raw bytes, never pickles."""

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
"""First byte that the child writes, once it accepts requests."""

FAILED = 3
"""Exit code of a child after an exception caused by the file."""

MAX_HEAD_BYTES = 2**22
MAX_BODY_BYTES = 2**26
MAX_DATA = 64
"""Maximum length of the data of a CAN FD frame, in bytes."""

HEAD_NUMBERS = ("epoch", "first_index", "start_ns", "n_samples", "ok")

Message = tuple[dict[str, Any], bytes]

Frames = npt.NDArray[np.void]
"""(n_frames,) data frames of type `FRAME` in log order, without error and remote frames."""

Rejected = tuple[int, str, int]
"""Row of the block in the message, reason of the rejection, number of rejected samples."""


def send(stream: BinaryIO, head: dict[str, Any], body: bytes = b"") -> None:
    """Write one message to a stream."""
    text = json.dumps(head, ensure_ascii=False).encode("utf-8", "surrogatepass")
    stream.write(len(text).to_bytes(4, "little") + len(body).to_bytes(4, "little") + text + body)


def receive(stream: BinaryIO) -> Message:
    """Read one message from a stream; return its JSON header and its raw bytes.

    Raises
    ------
    ConfigError
        If the message is malformed or too long.
    EOFError
        If the stream ends within the message.
    """
    lengths = _read(stream, 8)
    n_head, n_body = (int.from_bytes(lengths[at : at + 4], "little") for at in (0, 4))
    if n_head > MAX_HEAD_BYTES or n_body > MAX_BODY_BYTES:
        raise ConfigError(f"message from the reading process is too long: {n_head + n_body} bytes")
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
    """Header of a recorded block; fields as in :class:`acquisition.delivery.blocks.RawBlock`."""

    epoch: int
    first_index: int
    start_ns: int
    n_samples: int
    ok: tuple[bool, ...]
    slow: tuple[float, ...]
    rejected: tuple[Rejection, ...]


def head_type(n_slow: int) -> np.dtype[np.void]:
    """Return the dtype of a block header; ``ok`` has one bit per channel, channel 0 lowest."""
    return np.dtype([*((name, "<i8") for name in HEAD_NUMBERS), ("slow", "<f8", (n_slow,))])


def blocks_message(
    heads: npt.NDArray[np.void],
    rejected: Sequence[Rejected] = (),
    counts: RawArray | None = None,
    done: float = 0.0,
) -> Message:
    """Return a message with consecutive blocks.

    Parameters
    ----------
    heads
        (n_blocks,) block headers of type :func:`head_type`.
    rejected
        Rejections before the blocks.
    counts
        (n_channels, n_samples) samples of all blocks; None for a message with headers only.
    done
        Fraction of the file that has been read.
    """
    head = {"kind": "blocks", "done": done, "n": len(heads), "rejected": rejected}
    if counts is None:
        return head, heads.tobytes()
    return head | {"sample_type": counts.dtype.name}, heads.tobytes() + counts.tobytes()


def block_message(block: RawBlock, done: float) -> Message:
    """Return a message with a single block."""
    row = np.zeros(1, head_type(len(block.slow)))
    ok = sum(is_ok << n for n, is_ok in enumerate(block.ok))
    row[0] = (block.epoch, block.first_index, block.start_ns, block.n_samples, ok, block.slow)
    return blocks_message(row, (), block.counts, done)


@dataclass(frozen=True)
class BlockLayout:
    """Expected layout of the blocks from a child: channels and permitted sample types."""

    calibration: UnitCalibration
    sample_types: tuple[str, ...] = ("int16", "float32")

    def heads(self, message: Message) -> list[BlockHead]:
        """Return the headers of the blocks in a message.

        Raises
        ------
        ConfigError
            If the message does not contain blocks of this layout.
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
        """Yield the sample blocks in a message; blocks without a gap between them are joined.

        Raises
        ------
        ConfigError
            As in :meth:`heads`, and if the samples do not match the headers.
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
        """Return (n_blocks,) headers of `head_type`, the rejections by row, and the sample type."""
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
    """Return a mask (n_blocks,): whether a block follows the previous one without a gap.

    Rejected samples before a block count as a gap. False for the first block.
    """
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
"""CAN data frame: UTC time, identifier without flags, whether the identifier has 29 bits, whether
the frame is CAN FD, data length in bytes, and the data padded with zeros."""


def frames_message(frames: Frames, done: float) -> Message:
    """Return a message with CAN frames; `done` is the fraction of the file that has been read."""
    return {"kind": "frames", "done": done}, frames.tobytes()


def frames_of(message: Message) -> Frames:
    """Return the CAN frames in a message.

    Raises
    ------
    ConfigError
        If the message is malformed.
    """
    if len(message[1]) % FRAME.itemsize:
        raise _malformed()
    return np.frombuffer(message[1], FRAME)


def _malformed() -> ConfigError:
    return ConfigError("malformed message from the reading process")
