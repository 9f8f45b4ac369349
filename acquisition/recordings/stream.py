"""How the reading process hands its findings over: short JSON heads and plain bytes, no objects."""

import json
import math
from collections.abc import Callable
from typing import Any, BinaryIO

import numpy as np

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.frames import FrameBatch
from core.arrays import RawArray

MAX_HEAD = 65_536
MAX_BODY = 2**26
_LENGTHS = 8

Message = tuple[dict[str, Any], bytes]


def send(stream: BinaryIO, head: dict[str, Any], body: bytes = b"") -> None:
    """Write one message."""
    text = json.dumps(head).encode()
    stream.write(len(text).to_bytes(4, "little") + len(body).to_bytes(4, "little") + text + body)


def receive(read: Callable[[int], bytes]) -> Message:
    """Read one message.

    Parameters
    ----------
    read
        Gives just so many bytes.

    Raises
    ------
    ConfigError
        If it is none, or longer than any can be.
    """
    lengths = read(_LENGTHS)
    n_head, n_body = (int.from_bytes(lengths[at : at + 4], "little") for at in (0, 4))
    if n_head > MAX_HEAD or n_body > MAX_BODY:
        raise ConfigError(f"a message of {n_head} + {n_body} bytes from the reading process")
    try:
        head = json.loads(read(n_head))
    except (ValueError, RecursionError) as error:
        raise ConfigError("a message from the reading process that is none") from error
    if not isinstance(head, dict):
        raise ConfigError("a message from the reading process that is none")
    return head, read(n_body)


def block_message(block: RawBlock, done: float) -> Message:
    """A block as a message."""
    head = {
        "kind": "block",
        "done": done,
        "epoch": block.epoch,
        "first_index": block.first_index,
        "start_ns": block.start_ns,
        "slow": [value if math.isfinite(value) else None for value in block.slow],
    }
    return head, np.ascontiguousarray(block.counts).tobytes()


def block_of(message: Message, rate_hz: float, n_channels: int, sample_type: str) -> RawBlock:
    """The block of a message.

    Raises
    ------
    ConfigError
        If it is none of this many channels.
    """
    head, body = message
    size = np.dtype(sample_type).itemsize * n_channels
    slow = head.get("slow")
    numbers = [head.get(name) for name in ("epoch", "first_index", "start_ns")]
    if (
        not body
        or len(body) % size
        or not all(type(number) is int for number in numbers)
        or not isinstance(slow, list)
        or not all(value is None or isinstance(value, float | int) for value in slow)
    ):
        raise ConfigError("a block from the reading process that is none")
    counts: RawArray = np.frombuffer(body, dtype=sample_type).reshape(n_channels, -1)
    return RawBlock(
        epoch=head["epoch"],
        first_index=head["first_index"],
        start_ns=head["start_ns"],
        rate_hz=rate_hz,
        counts=counts,
        ok=(True,) * n_channels,
        slow=tuple(math.nan if value is None else float(value) for value in slow),
    )


def frames_message(batch: FrameBatch, done: float) -> Message:
    """Frames as a message."""
    head = {"kind": "frames", "done": done, "n": len(batch.times_ns)}
    return head, b"".join(np.ascontiguousarray(part).tobytes() for part in batch.columns)


def frames_of(message: Message) -> FrameBatch:
    """The frames of a message.

    Raises
    ------
    ConfigError
        If they are none.
    """
    head, body = message
    n_frames = head.get("n")
    if type(n_frames) is not int or n_frames * FrameBatch.bytes_per_frame() != len(body):
        raise ConfigError("frames from the reading process that are none")
    return FrameBatch.from_bytes(body, n_frames)
