"""CAN frames of the simulated CAN DAQ, and their encoder."""

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from can.util import CAN_FD_DLC

from acquisition.simulated.devices.can_shape import CanShape, MessageShape
from core.samples.blocks import SampleBlock

_NS_PER_US = 1000
_US_PER_S = 1_000_000
_U16, _U32 = 1 << 16, 1 << 32


class FrameKind(Enum):
    """Kind of a CAN frame; `BUS_OFF` is the report that the controller has left the bus."""

    DATA = "data"
    REMOTE = "remote"
    ERROR = "error"
    BUS_OFF = "bus_off"


@dataclass(frozen=True, slots=True)
class WireFrame:
    """CAN frame of the simulated DAQ.

    Parameters
    ----------
    extended
        Whether the id has 29 bits rather than 11.
    fd
        Whether the frame is a CAN FD frame rather than a classic CAN frame.
    wave
        Whether the frame is a waveform frame, which carries samples.
    """

    frame_id: int
    extended: bool
    fd: bool
    data: bytes
    kind: FrameKind = FrameKind.DATA
    wave: bool = False


class FrameEncoder:
    """Encoder of sample blocks as CAN frames in a message format."""

    def __init__(self, shape: CanShape) -> None:
        self._heads = [m for m in shape.messages if m.first_channel is None]
        self._waves = shape.waves
        self._shape = shape

    def frames(self, raw: SampleBlock) -> list[WireFrame]:
        """Return all frames of a block in transmission order."""
        values = self._head_values(raw)
        frames = [self._head(message, values) for message in self._heads]
        columns = [self._wave(message, raw) for message in self._waves]
        frames += [frame for instant in zip(*columns, strict=True) for frame in instant]
        return frames

    def _head_values(self, raw: SampleBlock) -> dict[str, float]:
        seconds, microseconds = divmod(raw.start_ns // _NS_PER_US, _US_PER_S)
        values: dict[str, float] = {
            "index": raw.first_index % _U32,
            "counter": raw.first_index % _U16,
            "epoch": raw.epoch % _U32,
            "n_samples": raw.n_samples,
            "ok": sum(1 << c for c, ok in enumerate(raw.side.ok[:, 0]) if ok),
            "seconds": seconds,
            "microseconds": microseconds,
        }
        names = [f.name for m in self._heads for f in m.fields if f.name not in values]
        return values | dict(zip(names, raw.side.slow[:, 0].tolist(), strict=True))

    def _head(self, message: MessageShape, values: dict[str, float]) -> WireFrame:
        record = message.records(1)
        for field in message.fields:
            record[field.name] = values[field.name]
        return self._frame(message, record.tobytes(), wave=False)

    def _wave(self, message: MessageShape, raw: SampleBlock) -> list[WireFrame]:
        n_per_frame = self._shape.samples_per_frame
        n_frames = -(-raw.n_samples // n_per_frame)
        first = np.arange(n_frames) * n_per_frame
        records = message.records(n_frames)
        records["counter"] = (raw.first_index + first) % _U16
        if self._shape.fd:
            records["valid"] = np.minimum(raw.n_samples - first, n_per_frame)
        channels = range(message.first_channel or 0, len(self._shape.channels))
        names = [f.name for f in message.fields if f.name not in ("counter", "valid")]
        for channel, start in zip(channels, range(0, len(names), n_per_frame), strict=False):
            for n, name in enumerate(names[start : start + n_per_frame]):
                samples = raw.counts[channel, n::n_per_frame]
                records[name][: len(samples)] = samples
        data, length = records.tobytes(), message.length
        return [
            self._frame(message, data[n * length : (n + 1) * length], wave=True)
            for n in range(n_frames)
        ]

    @staticmethod
    def _frame(message: MessageShape, data: bytes, wave: bool) -> WireFrame:
        return WireFrame(message.frame_id, message.extended, message.fd, data, wave=wave)


def shortened(frame: WireFrame) -> WireFrame:
    """Return a copy of a frame with its data truncated to the next shorter CAN FD data length."""
    length = max(n for n in CAN_FD_DLC if n < len(frame.data))
    return replace(frame, data=frame.data[:length])
