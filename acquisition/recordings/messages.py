"""Messages from the confined child process: a short JSON header and raw bytes, never pickles."""

import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, NonNegativeInt, ValidationError

from acquisition.errors import ConfigError
from acquisition.recordings.manifest import (
    MAX_BLOCK_SAMPLES,
    MAX_INDEX,
    MAX_REASON_LENGTH,
    MAX_REJECTIONS,
    SampleType,
)
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
"""Fields of a block header, before the slow values."""

Message = tuple[dict[str, Any], bytes]

Frames = npt.NDArray[np.void]
"""(n_frames,) data frames of type `FRAME` in log order, without error and remote frames."""

Heads = npt.NDArray[np.void]
"""(n_blocks,) headers of recorded blocks, of type :func:`head_type`; each has one cell."""

Rejected = tuple[int, str, int]
"""Row of the block in the message, reason of the rejection, number of rejected samples."""


def send(stream: BinaryIO, head: dict[str, Any], body: bytes = b"") -> None:
    """Write one message, a JSON header and raw bytes, to a stream."""
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


def head_type(n_slow: int) -> np.dtype[np.void]:
    """Return the dtype of a block header; ``ok`` has one bit per channel, channel 0 lowest."""
    return np.dtype([*((name, "<i8") for name in HEAD_NUMBERS), ("slow", "<f8", (n_slow,))])


def blocks_message(
    heads: Heads,
    rejected: Sequence[Rejected] = (),
    counts: RawArray | None = None,
    done: float = 0.0,
) -> Message:
    """Return a message with consecutive blocks, and the rejections before them.

    Parameters
    ----------
    counts
        (n_channels, n_samples) samples of all blocks; None for a message with headers only.
    done
        Fraction of the file that has been read.
    """
    head = {"kind": "blocks", "done": done, "n": len(heads), "rejected": rejected}
    if counts is None:
        return head, heads.tobytes()
    return head | {"sample_type": counts.dtype.name}, heads.tobytes() + counts.tobytes()


def heads_of(block: SampleBlock) -> Heads:
    """Return the headers of the cells of a block."""
    side = block.side
    heads = np.empty(side.n_cells, head_type(len(side.slow)))
    heads["epoch"], heads["first_index"] = block.epoch, block.first_index + side.starts
    heads["start_ns"] = side.start_ns
    heads["n_samples"] = np.diff(side.starts, append=block.n_samples)
    heads["ok"] = (side.ok.astype(np.int64) << np.arange(len(side.ok))[:, np.newaxis]).sum(axis=0)
    heads["slow"] = side.slow.T
    return heads


def blocks_in(
    message: Message,
    calibration: UnitCalibration,
    sample_types: Sequence[str] = ("int16", "float32"),
) -> Iterator[SampleBlock]:
    """Yield the blocks in a message; blocks without a gap between them are joined.

    Raises ConfigError if the message does not contain blocks with the channels of `calibration`, or
    their samples are of none of the types `sample_types`.
    """
    heads, rejected, sample_type = heads_in(message, len(calibration.slow))
    n_channels, n_samples = len(calibration.channels), heads["n_samples"]
    is_possible = ((n_samples > 0) & (n_samples <= len(message[1]))).all()
    if sample_type not in sample_types or not is_possible:
        raise _malformed()
    samples: RawArray = np.frombuffer(message[1], sample_type, offset=heads.nbytes)
    if len(samples) != n_channels * int(n_samples.sum()):
        raise _malformed()
    samples, stops = samples.reshape(n_channels, -1), np.cumsum(n_samples)
    is_ok = (heads["ok"] >> np.arange(n_channels)[:, np.newaxis] & 1).astype(np.bool_)
    expected = (heads["first_index"] + n_samples)[:-1]
    begins = (np.diff(heads["epoch"]) != 0) | (heads["first_index"][1:] != expected)
    firsts = sorted({0, *(np.flatnonzero(begins) + 1).tolist(), *rejected})
    for first, stop in itertools.pairwise([*firsts, len(heads)] if len(heads) else []):
        start, cells = int(stops[first] - n_samples[first]), slice(first, stop)
        yield SampleBlock(
            calibration=calibration,
            epoch=int(heads["epoch"][first]),
            first_index=int(heads["first_index"][first]),
            counts=samples[:, start : int(stops[stop - 1])],
            side=SideValues(
                starts=stops[cells] - n_samples[cells] - start,
                start_ns=heads["start_ns"][cells],
                ok=is_ok[:, cells],
                slow=heads["slow"][cells].T,
            ),
            rejected=tuple(rejected.get(first, ())),
        )


def heads_in(
    message: Message, n_slow: int
) -> tuple[Heads, Mapping[int, list[Rejection]], SampleType | None]:
    """Return the headers in a message, the rejections by row, and the sample type or None.

    Raises ConfigError if the message does not contain blocks with `n_slow` slow values each.
    """
    try:
        head = _BlocksHead.model_validate(message[0])
    except ValidationError as error:
        raise _malformed() from error
    type_ = head_type(n_slow)
    if head.n * type_.itemsize > len(message[1]):
        raise _malformed()
    rejected: dict[int, list[Rejection]] = {}
    for row, reason, n_rejected in head.rejected:
        if not 0 <= row < head.n:
            raise _malformed()
        rejected.setdefault(row, []).append(Rejection(reason, n_rejected))
    return np.frombuffer(message[1], type_, head.n), rejected, head.sample_type


@dataclass(frozen=True)
class Progress:
    """Position in a recording after the last block that was written or read.

    Parameters
    ----------
    n_blocks, n_samples
        Number of blocks, and of samples per channel, so far.
    n_passed
        Number of samples per channel, including those missing in gaps within an epoch.
    epoch
        Epoch of the last block; None before the first block.
    stop_index
        Sample index after the end of the last block; 0 before the first block.
    """

    n_blocks: int = 0
    n_samples: int = 0
    n_passed: int = 0
    epoch: int | None = None
    stop_index: int = 0

    def missing(self, heads: Heads) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.int64]]:
        """Return whether each block continues an epoch, and the number of samples missing before.

        Both are (n_blocks,) arrays. In a new epoch, the samples before the first index are missing.
        """
        stops = heads["first_index"] + heads["n_samples"]
        continues = np.append(-1 if self.epoch is None else self.epoch, heads["epoch"][:-1])
        continues = continues == heads["epoch"]
        expected = np.where(continues, np.append(self.stop_index, stops[:-1]), 0)
        return continues, np.maximum(heads["first_index"] - expected, 0)

    def after(
        self, heads: Heads, rejected: Mapping[int, Sequence[Rejection]], n_channels: int
    ) -> "Progress":
        """Return the position after the next blocks; `rejected` is by index in `heads`.

        Raises ConfigError if a block is invalid at this position; the message contains its number.
        """
        for name, least, most in (
            ("n_samples", 1, MAX_BLOCK_SAMPLES),
            ("epoch", 0, MAX_INDEX),
            ("first_index", 0, MAX_INDEX),
            ("ok", 0, (1 << n_channels) - 1),
        ):
            wrong = np.flatnonzero((heads[name] < least) | (heads[name] > most))
            if wrong.size:
                place, found = f"block {self.n_blocks + wrong[0]}", heads[name][wrong[0]]
                raise ConfigError(f"{place}: {name} must be {least} to {most}, got {found}")
        continues, n_missing = self.missing(heads)
        for row, rejections in rejected.items():
            wrong_words = _wrong_rejections(rejections, int(n_missing[row]))
            if wrong_words:
                raise ConfigError(f"block {self.n_blocks + row}: {wrong_words}")
        n_samples = int(heads["n_samples"].sum())
        return Progress(
            self.n_blocks + len(heads),
            self.n_samples + n_samples,
            self.n_passed + n_samples + int(n_missing[continues].sum()),
            int(heads["epoch"][-1]),
            int(heads["first_index"][-1] + heads["n_samples"][-1]),
        )


def _wrong_rejections(rejections: Sequence[Rejection], n_missing: int) -> str:
    """Return how the rejections before a block are invalid; empty if they are valid."""
    if len(rejections) > MAX_REJECTIONS:
        return f"{len(rejections)} rejections, more than {MAX_REJECTIONS}"
    for each in rejections:
        if not 1 <= len(each.reason) <= MAX_REASON_LENGTH or each.n_samples < 1:
            return (
                f"a rejection must have at least 1 sample and a reason of 1 to {MAX_REASON_LENGTH}"
                f" characters, got {each.n_samples} and {each.reason[:80]!r}"
            )
    n_rejected = sum(each.n_samples for each in rejections)
    return f"{n_rejected} rejected, but {n_missing} missing samples" * (n_rejected > n_missing)


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

    Raises ConfigError if the message is malformed.
    """
    if len(message[1]) % FRAME.itemsize:
        raise _malformed()
    return np.frombuffer(message[1], FRAME)


def _malformed() -> ConfigError:
    return ConfigError("malformed message from the reading process")
