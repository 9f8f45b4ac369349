"""Readers of DBC signals in single and in concatenated frames; decoder of waveforms."""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from acquisition.can.dbc import DbcSignal
from acquisition.can.settings import CanChannel
from acquisition.delivery.units import known_unit, spellings
from acquisition.errors import ConfigError
from core.arrays import RawArray
from core.checks.channels import COUNTS_FULL_SCALE
from core.samples.calibration import ChannelCalibration

ScalarReader: TypeAlias = Callable[[bytes], int | float]
"""Function that returns the unscaled value of one signal in one frame."""

ColumnReader: TypeAlias = Callable[[bytes], npt.NDArray[Any]]
"""Function that returns the (n_frames,) unscaled values of one signal in concatenated frames."""

_BITS_PER_BYTE = 8
_INTEGERS = {8: "b", 16: "h", 32: "i", 64: "q"}
_FLOATS = {32: "f", 64: "d"}


def byte_offset(signal: DbcSignal) -> int | None:
    """Return the position of a signal's first byte in its frame; None if numpy cannot read it.

    numpy reads byte-aligned integers of 8, 16, 32 and 64 bits, and floats of 32 and 64 bits.
    """
    source = signal.source
    offset, bit = divmod(source.start, _BITS_PER_BYTE)
    first_bit = _BITS_PER_BYTE - 1 if source.byte_order == "big_endian" else 0
    lengths = _FLOATS if source.is_float else _INTEGERS
    return offset if bit == first_bit and source.length in lengths else None


def scalar_reader(signal: DbcSignal) -> ScalarReader:
    """Return a reader of a signal in one frame; cantools decodes signals without byte alignment.

    The reader raises FrameError if cantools cannot decode the frame.
    """
    offset, message, name = byte_offset(signal), signal.message, signal.source.name
    if offset is None:
        return lambda data: message.raw_value(name, data)
    unpack = struct.Struct(_format_of(signal)).unpack_from
    return lambda data: unpack(data, offset)[0]


def column_reader(signal: DbcSignal) -> ColumnReader:
    """Return a reader of a signal in concatenated frames; numpy reads byte-aligned signals.

    The reader raises FrameError if cantools cannot decode a frame.
    """
    offset, length = byte_offset(signal), signal.message.length
    if offset is None:
        read = scalar_reader(signal)
        return lambda frames: np.array(
            [read(frames[n : n + length]) for n in range(0, len(frames), length)]
        )
    dtype = np.dtype(_format_of(signal))
    return lambda frames: np.ndarray(len(frames) // length, dtype, frames, offset, (length,))


def _format_of(signal: DbcSignal) -> str:
    """Return byte order and type of a signal as a format of numpy and struct."""
    source = signal.source
    order = ">" if source.byte_order == "big_endian" else "<"
    if source.is_float:
        return order + _FLOATS[source.length]
    letter = _INTEGERS[source.length]
    return order + (letter if source.is_signed else letter.upper())


_FACTOR_TOLERANCE = 1e-6
_COUNT_BITS = 16
_V_PER = {"V": 1.0, "mV": 1e-3}
_COUNTS = ("", "1", "count", "counts")
"""DBC units of a dimensionless count."""


@dataclass(frozen=True)
class WaveChannel:
    """Waveform channel with the readers of its samples.

    Parameters
    ----------
    wave
        Index of the channel's message among the waveform messages.
    columns
        Reader of each sample in a frame.
    gain
        Engineering units per raw unit: value = raw value * gain + offset.
    offset
        Value in engineering units for the raw value 0.
    """

    wave: int
    columns: tuple[ColumnReader, ...]
    gain: float
    offset: float


@dataclass(frozen=True)
class WaveformDecoder:
    """Decoder of the frames of all waveform channels to one sample array.

    `in_counts` is whether the raw values are counts of a 16-bit converter.
    """

    channels: tuple[WaveChannel, ...]
    in_counts: bool

    def samples(self, frames: Sequence[Sequence[bytes]]) -> RawArray:
        """Return the samples in the frames of consecutive sample instants.

        Parameters
        ----------
        frames
            Frames of all instants, one sequence for each waveform message.

        Returns
        -------
        (n_channels, n_instants * samples_per_frame), int16 counts or float32 engineering units.
        """
        joined = [b"".join(of_message) for of_message in frames]
        n_per_frame = len(self.channels[0].columns)
        shape = (len(self.channels), len(frames[0]) * n_per_frame)
        samples: RawArray = (
            np.empty(shape, np.int16) if self.in_counts else np.empty(shape, np.float32)
        )
        for row, channel in zip(samples, self.channels, strict=True):
            is_scaled = not self.in_counts and (channel.gain, channel.offset) != (1.0, 0.0)
            for n, read in enumerate(channel.columns):
                raw = read(joined[channel.wave])
                row[n::n_per_frame] = (
                    raw.astype(np.float64) * channel.gain + channel.offset if is_scaled else raw
                )
        return samples


def is_counts(signal: DbcSignal) -> bool:
    """Return whether a signal is a count of a 16-bit converter: signed, in volts or unitless."""
    source = signal.source
    plain = source.is_signed and not source.is_float and source.length == _COUNT_BITS
    return (
        plain
        and byte_offset(signal) is not None
        and source.offset == 0.0
        and (known_unit(signal.unit) in _V_PER or (signal.unit in _COUNTS and source.scale == 1.0))
    )


def wave_channel(
    wave: int, channel: CanChannel, calibration: ChannelCalibration, signals: Sequence[DbcSignal]
) -> WaveChannel:
    """Return a waveform channel with the gain, offset and readers of its signals.

    `wave` is the index of its message among the waveform messages.

    Raises ConfigError if unit, factor or full scale in the DBC do not match the channel, or its
    signals differ in their factors.
    """
    scalings = {_gain_and_offset(channel, calibration, signal) for signal in signals}
    if len(scalings) > 1:
        raise ConfigError(
            f"signals.{channel.id}: all signals of the channel must have the same factor and"
            f" offset in the DBC file, found {sorted(scalings)}"
        )
    for signal in filter(is_counts, signals):
        _require_full_scale(channel, calibration, signal)
    return WaveChannel(wave, tuple(column_reader(s) for s in signals), *scalings.pop())


def _gain_and_offset(
    channel: CanChannel, calibration: ChannelCalibration, signal: DbcSignal
) -> tuple[float, float]:
    """Return gain and offset from raw values to the channel's engineering unit."""
    unit, source = known_unit(signal.unit), signal.source
    if is_counts(signal) and signal.unit in _COUNTS:
        return calibration.unit_per_count, 0.0
    if unit in _V_PER:
        scale = _V_PER[unit] * calibration.unit_per_v
        return source.scale * scale, source.offset * scale
    if unit == channel.unit:
        return source.scale, source.offset
    raise ConfigError(
        f'channel {channel.id}: {signal.path} has unit "{signal.unit}" in the DBC file, expected'
        f" {spellings(channel.unit)}, V or mV"
    )


def _require_full_scale(
    channel: CanChannel, calibration: ChannelCalibration, signal: DbcSignal
) -> None:
    """Raise ConfigError if the full scale in the DBC differs from that in the plant file."""
    v_per_unit = _V_PER.get(known_unit(signal.unit) or "")
    if v_per_unit is None:
        return
    by_dbc_v = signal.source.scale * v_per_unit * COUNTS_FULL_SCALE
    if abs(by_dbc_v - calibration.full_scale_v) > _FACTOR_TOLERANCE * calibration.full_scale_v:
        raise ConfigError(
            f"channel {channel.id}: full_scale_v is {calibration.full_scale_v:.9g} in the plant"
            f" file, but factor {signal.source.scale!r} {signal.unit} of {signal.path} in the DBC"
            f" file corresponds to {by_dbc_v:.9g}; correct one of them"
        )
