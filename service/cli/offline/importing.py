"""Import of foreign files and CAN logs into recordings."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from datetime import datetime, timedelta
from itertools import chain
from pathlib import Path

import can
import numpy as np

from acquisition.can.assembly import FrameAssembler
from acquisition.can.compiler import compile_plan
from acquisition.can.gate import FrameGate
from acquisition.can.settings import CanSettings
from acquisition.delivery.blocks import BlockJoiner
from acquisition.delivery.units import slow_conversion, waveform_factor
from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import (
    ChannelColumn,
    ColumnName,
    CsvLayout,
    ImportJob,
    SlowColumn,
    TimeAxis,
)
from acquisition.recordings.manifest import Manifest, read_manifest
from acquisition.recordings.messages import MAX_DATA, Frames
from acquisition.recordings.reading import imported_blocks, imported_frames
from acquisition.recordings.writer import RecordingWriter
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration
from service.runtime.times import EPOCH
from service.settings.adapter_values import recorded_unit
from service.settings.can_values import can_settings_of
from service.settings.core_values import calibration_of
from service.settings.sources.can import CanSettings as CanSourceSettings
from service.settings.sources.mapping import (
    ImportMapping,
    MappedChannel,
    MappedSlowChannel,
    TimeSettings,
)
from service.settings.units import UnitSettings


class CanLogDecoder:
    """Decoder of logged CAN frames into the blocks that a CAN source would have delivered.

    Samples without a device time stamp get the time stamp of their frame in the log.

    Raises
    ------
    ConfigError
        If DBC, settings and calibration are inconsistent.
    """

    def __init__(self, settings: CanSettings, calibration: UnitCalibration) -> None:
        plan = compile_plan(settings, calibration)
        self._assembler = FrameAssembler(plan)
        self._gate = FrameGate(plan, self._assembler.refused)

    def take(self, frames: Frames) -> list[SampleBlock]:
        """Decode the next frames of a log; return the blocks that they complete, possibly none.

        Raises
        ------
        ConfigError
            If the frames are not from one device.
        """
        blocks: list[SampleBlock] = []
        for time_ns, message in zip(frames["time_ns"].tolist(), _messages(frames), strict=True):
            frame = self._gate.admit(message)
            if frame is not None:
                blocks += self._assembler.take([frame], time_ns)
        if self._assembler.trouble:
            raise ConfigError(self._assembler.trouble)
        return blocks


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


def _import_job(mapping: ImportMapping, unit: UnitSettings) -> ImportJob:
    """Return the description of an import, the input of the process that reads the file.

    Raises
    ------
    ConfigError
        If a waveform channel of the unit is not mapped, a mapped channel is unknown, or it is
        mapped with a unit that does not fit.
    """
    channels = {channel.id: channel for channel in mapping.channel}
    slow = {channel.id: channel for channel in mapping.slow_channel}
    _require_known(slow, [c.id for c in unit.slow_channel], "slow channel", unit.id)
    if channels:
        known = [c.id for c in unit.channel]
        _require_known(channels, known, "channel", unit.id)
        missing = [id_ for id_ in known if id_ not in channels]
        if missing:
            raise ConfigError(
                f"the mapping does not contain these channels of unit {unit.id}:"
                f" {', '.join(missing)}; add a [[channel]] table for each"
            )
    csv = CsvLayout(**mapping.csv.model_dump()) if mapping.csv else CsvLayout()
    return ImportJob(
        format=mapping.format,
        rate_hz=unit.rate_hz,
        time=_time_axis(mapping.time),
        channels=_channels(channels, unit) if channels else (),
        slow=tuple(_slow(slow[c.id], c.unit) for c in unit.slow_channel if c.id in slow),
        block_samples=unit.block_samples,
        csv=csv,
        bus=mapping.bus,
    )


def import_recording(
    path: Path,
    mapping: ImportMapping,
    unit: UnitSettings,
    folder: Path,
    made_by: str,
    *,
    advanced: Callable[[float], None] = lambda _: None,
) -> Manifest:
    """Write the samples of a foreign file as a recording of a unit into the new `folder`.

    Returns the manifest of the recording, in which `made_by` names its author.

    Parameters
    ----------
    advanced
        Called with the share of the file that has been read, 0 to 1.

    Raises
    ------
    ConfigError
        If file, mapping and unit are inconsistent, or the file is damaged; no files remain.
    """
    job = _import_job(mapping, unit)
    if job.channels:
        read = imported_blocks(path, job)
    elif isinstance(unit.source, CanSourceSettings):
        settings, calibration = can_settings_of(unit, unit.source), calibration_of(unit)
        decoder, logged = CanLogDecoder(settings, calibration), imported_frames(path, job)
        read = ((block, done) for frames, done in logged for block in decoder.take(frames))
    else:
        raise ConfigError(
            f'unit {unit.id} has no source of kind "can"; add one, since a CAN log is decoded'
            " with its DBC file"
        )
    recorded = recorded_unit(unit)
    joiner = BlockJoiner(job.block_samples)
    with closing(read) as found:
        first = next(found, None)
        if first is None:
            raise ConfigError(f"{path}: no samples of unit {unit.id}; check file and mapping")
        with RecordingWriter(folder, recorded, made_by) as writer:
            for part, done in chain([first], found):
                whole = _with_all_slow(part, recorded.calibration)
                for block in joiner.put([whole]):
                    writer.write(block)
                advanced(done)
            for block in joiner.flush():
                writer.write(block)
    return read_manifest(folder)


def _with_all_slow(block: SampleBlock, calibration: UnitCalibration) -> SampleBlock:
    """Return the block with all slow channels; slow channels that the file lacks are NaN."""
    found = dict(zip(block.calibration.slow_ids, block.side.slow, strict=True))
    missing = np.full(block.side.n_cells, np.nan)
    slow = np.array([found.get(id_, missing) for id_ in calibration.slow_ids])
    side = replace(block.side, slow=slow.reshape(-1, block.side.n_cells))
    return replace(block, calibration=calibration, side=side)


def _channels(mapped: Mapping[str, MappedChannel], unit: UnitSettings) -> tuple[ChannelColumn, ...]:
    found = []
    for channel, calibration in zip(unit.channel, calibration_of(unit).channels, strict=True):
        column = mapped[channel.id]
        try:
            factor = waveform_factor(channel.measurand, column.unit, calibration.unit_per_v)
        except ConfigError as error:
            raise ConfigError(f"channel {channel.id}: {error}") from error
        found.append(
            ChannelColumn(
                id=channel.id,
                place=ColumnName(column.column, column.group),
                unit=column.unit,
                factor=factor,
                calibrated_per_count=calibration.unit_per_count,
                per_count=column.unit_per_count,
            )
        )
    return tuple(found)


def _slow(column: MappedSlowChannel, channel_unit: str) -> SlowColumn:
    try:
        factor, offset = slow_conversion(channel_unit, column.unit)
    except ConfigError as error:
        raise ConfigError(f"slow channel {column.id}: {error}") from error
    time = ColumnName(column.time_column, column.time_group) if column.time_column else None
    place = ColumnName(column.column, column.group)
    return SlowColumn(column.id, place, column.unit, factor, offset, time)


def _time_axis(time: TimeSettings) -> TimeAxis:
    start_ns = None if time.start is None else (time.start - EPOCH) // timedelta(microseconds=1)
    return TimeAxis(
        kind=time.source,
        utc_offset_s=_utc_offset_s(time.zone),
        place=ColumnName(time.column, time.group) if time.column else None,
        form=time.form or "elapsed_s",
        start_ns=None if start_ns is None else start_ns * 1000,
        tolerance=time.tolerance,
    )


def _utc_offset_s(zone: str) -> int:
    offset = datetime.strptime("+00:00" if zone in ("UTC", "") else zone, "%z").utcoffset()
    return round((offset or timedelta()).total_seconds())


def _require_known(mapped: Mapping[str, object], known: list[str], kind: str, unit: str) -> None:
    for id_ in mapped:
        if id_ not in known:
            words = ", ".join(known) or "none"
            raise ConfigError(f"{kind} {id_} is mapped, but unit {unit} has only {words}")
