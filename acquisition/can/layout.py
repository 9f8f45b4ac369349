"""The signals of a frame as a numpy layout, and those of many frames as waveforms."""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from acquisition.can.dbc import DbcMessage, DbcSignal
from acquisition.can.settings import CanChannel
from acquisition.delivery.calibration import COUNTS_FULL_SCALE, ChannelCalibration
from acquisition.delivery.units import known_unit, spellings
from acquisition.errors import ConfigError
from core.arrays import RawArray

ScalarReader: TypeAlias = Callable[[bytes], int | float]
"""Reads one signal from one frame, not scaled."""

_BITS_PER_BYTE = 8
_INTEGERS = {8: "b", 16: "h", 32: "i", 64: "q"}
_FLOATS = {32: "f", 64: "d"}


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
                "formats": [_format_of(s) for s in aligned],
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
    lengths = _FLOATS if signal.is_float else _INTEGERS
    return offset if bit == first_bit and signal.n_bits in lengths else None


def scalar_reader(signal: DbcSignal) -> ScalarReader:
    """Reader of a single frame's signal: for counters, which decide where a frame belongs."""
    offset = byte_offset(signal)
    if offset is None:
        message, name = signal.message, signal.name
        return lambda data: message.raw_value(name, data)
    unpack = struct.Struct(_format_of(signal)).unpack_from
    return lambda data: unpack(data, offset)[0]


def _format_of(signal: DbcSignal) -> str:
    """Byte order and type of a signal, as numpy and struct write them."""
    order = ">" if signal.big_endian else "<"
    if signal.is_float:
        return order + _FLOATS[signal.n_bits]
    letter = _INTEGERS[signal.n_bits]
    return order + (letter if signal.signed else letter.upper())


_FACTOR_TOLERANCE = 1e-6
_COUNT_BITS = 16
_V_PER = {"V": 1.0, "mV": 1e-3}
_COUNTS = ("", "1", "count", "counts")
"""What stands for the unit of a plain count."""


@dataclass(frozen=True)
class WaveChannel:
    """A waveform channel and where its samples lie.

    Parameters
    ----------
    part
        Number of the message, among those that carry waveforms.
    gain, offset
        Engineering units = raw value * gain + offset.
    """

    part: int
    signals: tuple[str, ...]
    gain: float
    offset: float


class WaveformDecoder:
    """Puts the samples of all channels into one array.

    Parameters
    ----------
    layouts
        One for each message that carries waveforms.
    in_counts
        Whether the raw values are counts of a 16-bit converter.
    """

    def __init__(
        self, layouts: Sequence[FrameLayout], channels: Sequence[WaveChannel], in_counts: bool
    ) -> None:
        self._layouts = layouts
        self._channels = channels
        self.in_counts = in_counts

    def samples(self, frames: Sequence[Sequence[bytes]]) -> RawArray:
        """Decode frames of consecutive instants.

        Parameters
        ----------
        frames
            For each message, its frame of every instant.

        Returns
        -------
        (n_channels, n_instants * samples per frame) int16 counts or float32 engineering units.
        """
        columns = [layout.columns(f) for layout, f in zip(self._layouts, frames, strict=True)]
        n_per_frame = len(self._channels[0].signals)
        shape = (len(self._channels), len(frames[0]) * n_per_frame)
        samples: RawArray = (
            np.empty(shape, np.int16) if self.in_counts else np.empty(shape, np.float32)
        )
        for row, channel in zip(samples, self._channels, strict=True):
            is_scaled = not self.in_counts and (channel.gain, channel.offset) != (1.0, 0.0)
            for n, name in enumerate(channel.signals):
                raw = columns[channel.part][name]
                row[n::n_per_frame] = (
                    raw.astype(np.float64) * channel.gain + channel.offset if is_scaled else raw
                )
        return samples


def is_counts(signal: DbcSignal) -> bool:
    """Whether a signal is a 16-bit converter's count: signed, in volts or without unit."""
    plain = signal.signed and not signal.is_float and signal.n_bits == _COUNT_BITS
    unscaled = signal.unit in _COUNTS and signal.scale == 1.0
    return (
        plain
        and byte_offset(signal) is not None
        and signal.offset == 0.0
        and (known_unit(signal.unit) in _V_PER or unscaled)
    )


def require_full_scale(
    channel: CanChannel, calibration: ChannelCalibration, signal: DbcSignal
) -> None:
    """Refuse a count whose volts by the DBC differ from those by the plant file.

    Raises
    ------
    ConfigError
        Naming both.
    """
    v_per_unit = _V_PER.get(known_unit(signal.unit) or "")
    if v_per_unit is None:
        return
    by_dbc_v = signal.scale * v_per_unit * COUNTS_FULL_SCALE
    if abs(by_dbc_v - calibration.full_scale_v) > _FACTOR_TOLERANCE * calibration.full_scale_v:
        raise ConfigError(
            f"channel {channel.id}: {signal.path} has factor {signal.scale!r} {signal.unit}, which"
            f" is full_scale_v = {by_dbc_v:.9g}, but the plant file says"
            f" {calibration.full_scale_v:.9g}; correct the one that is wrong"
        )


def gain_and_offset(
    channel: CanChannel, calibration: ChannelCalibration, signal: DbcSignal
) -> tuple[float, float]:
    """How raw values become the channel's engineering unit.

    Raises
    ------
    ConfigError
        If the DBC's unit is neither the channel's nor volts.
    """
    unit = known_unit(signal.unit)
    if signal.unit in _COUNTS and is_counts(signal):
        return calibration.unit_per_count, 0.0
    if unit in _V_PER:
        scale = _V_PER[unit] * calibration.unit_per_v
        return signal.scale * scale, signal.offset * scale
    if unit == channel.unit:
        return signal.scale, signal.offset
    raise ConfigError(
        f'channel {channel.id}: {signal.path} has unit "{signal.unit}" in the DBC; needed is'
        f" {spellings(channel.unit)}, or V or mV"
    )
