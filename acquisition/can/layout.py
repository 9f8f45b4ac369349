"""Where signals lie in a frame, compiled once: frames are decoded in batches, not one by one."""

import struct
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from acquisition.can.dbc import DbcMessage, DbcSignal

ScalarReader: TypeAlias = Callable[[bytes], int | float]
"""Reads one signal from one frame, not scaled."""

_BITS_PER_BYTE = 8
_INTEGER_BITS = (8, 16, 32, 64)
_FLOAT_BITS = (32, 64)


class FrameLayout:
    """Decodes signals of one message from any number of its frames.

    What begins and ends at bytes becomes a field of a structured array; the rest goes through
    cantools, frame by frame.
    """

    def __init__(self, message: DbcMessage, signals: Sequence[DbcSignal]) -> None:
        self._message = message
        aligned = [s for s in signals if byte_offset(s) is not None]
        self._slow_names = [s.name for s in signals if byte_offset(s) is None]
        self.dtype = np.dtype(
            {
                "names": [s.name for s in aligned],
                "formats": [_format(s) for s in aligned],
                "offsets": [byte_offset(s) or 0 for s in aligned],
                "itemsize": message.length,
            }
        )

    def columns(self, frames: Sequence[bytes]) -> dict[str, npt.NDArray[Any]]:
        """Raw values of each signal by name, (n_frames,) each.

        Raises
        ------
        FrameError
            If cantools cannot decode a frame.
        """
        table = np.frombuffer(b"".join(frames), dtype=self.dtype)
        columns = {name: table[name] for name in self.dtype.names or ()}
        for name in self._slow_names:
            columns[name] = np.array([self._message.raw_value(name, data) for data in frames])
        return columns


def byte_offset(signal: DbcSignal) -> int | None:
    """First byte of a signal that fills bytes and has a numpy type; else None."""
    offset, bit = divmod(signal.start, _BITS_PER_BYTE)
    first_bit = _BITS_PER_BYTE - 1 if signal.big_endian else 0
    lengths = _FLOAT_BITS if signal.is_float else _INTEGER_BITS
    return offset if bit == first_bit and signal.n_bits in lengths else None


def scalar_reader(signal: DbcSignal) -> ScalarReader:
    """Reader of a single frame's signal: for counters, which decide where a frame belongs."""
    offset = byte_offset(signal)
    if offset is None:
        message, name = signal.message, signal.name
        return lambda data: message.raw_value(name, data)
    unpack = struct.Struct(_struct_format(signal)).unpack_from
    return lambda data: unpack(data, offset)[0]


def _format(signal: DbcSignal) -> str:
    kind = "f" if signal.is_float else "i" if signal.signed else "u"
    order = ">" if signal.big_endian else "<"
    return f"{order}{kind}{signal.n_bits // _BITS_PER_BYTE}"


def _struct_format(signal: DbcSignal) -> str:
    order = ">" if signal.big_endian else "<"
    if signal.is_float:
        return order + {32: "f", 64: "d"}[signal.n_bits]
    letter = {8: "b", 16: "h", 32: "i", 64: "q"}[signal.n_bits]
    return order + (letter if signal.signed else letter.upper())
