"""Whole lines of a CSV file, a few megabytes at a time, checked before anything parses them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from core.arrays import TimeArray
from service.cli.offline.back_test.file_columns import ReadingsError

CHUNK_BYTES = 4_000_000
MAX_LINE_BYTES = 16_384
"""Of a line of a hundred columns; the longest of padwatch's own have 300."""

_BOM = b"\xef\xbb\xbf"
_NUL, _LF, _CR, _QUOTE = 0, 10, 13, 34


@dataclass(frozen=True, eq=False)
class Lines:
    """Consecutive lines.

    Parameters
    ----------
    text
        UTF-8, each line with its end.
    number : (n,)
        Numbers in the file of those that are not empty.
    """

    text: bytes
    number: TimeArray


def checked_lines(stream: BinaryIO) -> Iterator[Lines]:
    """Read a file from its beginning.

    Raises
    ------
    ReadingsError
        At a line that is not text, too long, or has a NUL, a lone carriage return or an open quote.
    """
    first, rest = 1, stream.read(len(_BOM)).removeprefix(_BOM)
    while chunk := stream.read(CHUNK_BYTES):
        text, found, rest = (rest + chunk).rpartition(b"\n")
        if found:
            yield _checked(text + found, first)
            first += text.count(b"\n") + 1
        if len(rest) > MAX_LINE_BYTES:
            raise ReadingsError(f"line {first}: longer than {MAX_LINE_BYTES} bytes")
    if rest:
        yield _checked(rest + b"\n", first)


def _checked(text: bytes, first: int) -> Lines:
    byte = np.frombuffer(text, np.uint8)
    end = np.flatnonzero(byte == _LF)
    length = np.diff(end, prepend=-1) - 1
    _refuse(length > MAX_LINE_BYTES, first, f"longer than {MAX_LINE_BYTES} bytes")
    _refuse_at(np.flatnonzero(byte == _NUL), end, first, "has a NUL byte")
    returns = np.flatnonzero(byte == _CR)
    _refuse_at(returns[byte[returns + 1] != _LF], end, first, "a carriage return within the line")
    quotes = np.searchsorted(np.flatnonzero(byte == _QUOTE), end)
    _refuse(np.diff(quotes, prepend=0) % 2 == 1, first, "a quote is not closed")
    try:
        text.decode()
    except UnicodeDecodeError as error:
        _refuse_at(np.array([error.start]), end, first, "not UTF-8 text")
    is_return = byte[np.maximum(end - 1, 0)] == _CR
    return Lines(text, first + np.flatnonzero(length > is_return))


def _refuse_at(at: npt.NDArray[np.int64], end: npt.NDArray[np.int64], first: int, why: str) -> None:
    if at.size:
        raise ReadingsError(f"line {first + int(np.searchsorted(end, at[0]))}: {why}")


def _refuse(is_wrong: npt.NDArray[np.bool_], first: int, why: str) -> None:
    if is_wrong.any():
        raise ReadingsError(f"line {first + int(np.argmax(is_wrong))}: {why}")
