"""Frames of an imported CAN log through the decoder of live ones."""

from collections.abc import Iterator

import can

from acquisition.can.assembly import FrameAssembler
from acquisition.can.compiler import compile_plan
from acquisition.can.gate import FrameGate
from acquisition.can.settings import CanSettings
from acquisition.delivery.blocks import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.messages import MAX_DATA, Frames
from core.samples.calibration import UnitCalibration
from service.settings.can import CanSettings as CanSourceSettings
from service.settings.can_devices import can_settings_of
from service.settings.core_values import calibration_of
from service.settings.units import UnitSettings


class CanLogDecoder:
    """What a CAN source would have made of these frames, had it listened when they were logged.

    A device that does not stamp its samples gets the stamps of the log.

    Raises
    ------
    ConfigError
        If DBC, settings and calibration do not fit together.
    """

    def __init__(self, settings: CanSettings, calibration: UnitCalibration) -> None:
        plan = compile_plan(settings, calibration)
        self._assembler = FrameAssembler(plan)
        self._gate = FrameGate(plan, self._assembler.refused)

    def take(self, frames: Frames) -> list[RawBlock]:
        """Decode the next frames of a log.

        Raises
        ------
        ConfigError
            If they cannot all be those of one device.
        """
        blocks: list[RawBlock] = []
        for time_ns, message in zip(frames["time_ns"].tolist(), _messages(frames), strict=True):
            frame = self._gate.admit(message)
            if frame is not None:
                blocks += self._assembler.take([frame], time_ns)
        if self._assembler.trouble:
            raise ConfigError(self._assembler.trouble)
        return blocks


def log_decoder_of(unit: UnitSettings) -> CanLogDecoder | None:
    """The decoder of a unit that reads CAN; None for others, which cannot read CAN logs.

    Raises
    ------
    ConfigError
        If DBC, settings and calibration do not fit together.
    """
    if not isinstance(unit.source, CanSourceSettings):
        return None
    return CanLogDecoder(can_settings_of(unit, unit.source), calibration_of(unit))


def _messages(frames: Frames) -> Iterator[can.Message]:
    rows = frames[["time_ns", "id", "extended", "fd", "length"]].tolist()
    data = frames["data"].tobytes()
    for n, (time_ns, id_, extended, fd, length) in enumerate(rows):
        yield can.Message(
            timestamp=time_ns / 1e9,
            arbitration_id=id_,
            is_extended_id=extended,
            is_fd=fd,
            dlc=length,
            data=data[n * MAX_DATA : n * MAX_DATA + length],
        )
