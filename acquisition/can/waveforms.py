"""From the frames of complete sample instants to the samples of all waveform channels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from acquisition.can.dbc import DbcSignal
from acquisition.can.layout import FrameLayout, byte_offset
from acquisition.can.settings import CanChannel
from acquisition.can.units import known_unit, spellings
from acquisition.delivery.calibration import COUNTS_FULL_SCALE, ChannelCalibration
from acquisition.errors import ConfigError
from core.arrays import RawArray, SampleArray

_FACTOR_TOLERANCE = 1e-6
_COUNT_BITS = 16
_V_PER = {"V": 1.0, "mV": 1e-3}


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
        if self.in_counts:
            counts = np.empty(shape, dtype=np.int16)
            for row, channel in zip(counts, self._channels, strict=True):
                for n, name in enumerate(channel.signals):
                    row[n::n_per_frame] = columns[channel.part][name]
            return counts
        return self._engineering_units(columns, shape)

    def _engineering_units(
        self, columns: Sequence[Mapping[str, npt.NDArray[Any]]], shape: tuple[int, int]
    ) -> SampleArray:
        units = np.empty(shape, dtype=np.float32)
        for row, channel in zip(units, self._channels, strict=True):
            for n, name in enumerate(channel.signals):
                raw = columns[channel.part][name]
                if (channel.gain, channel.offset) != (1.0, 0.0):  # else to the last bit
                    raw = raw.astype(np.float64) * channel.gain + channel.offset
                row[n :: len(channel.signals)] = raw
        return units


def is_counts(signal: DbcSignal) -> bool:
    """Whether a signal is a 16-bit converter's count: signed, in volts or without unit."""
    plain = signal.signed and not signal.is_float and signal.n_bits == _COUNT_BITS
    unit = known_unit(signal.unit)
    unscaled = unit == "counts" and signal.scale == 1.0
    return (
        plain
        and byte_offset(signal) is not None
        and signal.offset == 0.0
        and (unit in _V_PER or unscaled)
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
    if unit == "counts" and is_counts(signal):
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
