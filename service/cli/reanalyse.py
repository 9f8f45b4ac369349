"""`padwatch reanalyse`: analyse a recording as live samples are analysed."""

from collections.abc import AsyncIterator, Iterator
from dataclasses import replace
from enum import StrEnum
from typing import Annotated

import typer
import uvloop
from pydantic_core import to_json

from acquisition.clock import SystemClock
from acquisition.recordings.reader import open_recording
from acquisition.recordings.source import RecordingSource
from acquisition.source import SampleSource
from core.monitor.assessment import Assessment
from core.monitor.catalogue import quantity_of
from core.monitor.monitor import UnitMonitor
from service.app.recordings import selection_of
from service.cli.offline.reanalysis import (
    LastAverages,
    assessment_document,
    calibration_differences,
    is_full,
    refreshes,
    stiffness_lines,
)
from service.cli.options import (
    PlantOption,
    RecordingFolder,
    UnitOption,
    fail,
    one_unit,
    option,
    progress,
)
from service.runtime.process import return_large_pieces
from service.runtime.times import rfc3339
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.plant import load_plant_file

BLOCK_S = 10.0
"""Length of the blocks of a recording; without alarms to raise, long ones cost least."""


class WindowChoice(StrEnum):
    """Choice of printed results: the last full average of each bearing, or all results."""

    LAST = "last"
    ALL = "all"


class CalibrationChoice(StrEnum):
    """Choice of calibration from counts to engineering units: recorded, or of the plant file."""

    RECORDED = "recorded"
    PLANT = "plant"


def reanalyse(
    recording: RecordingFolder,
    plant: PlantOption,
    unit: UnitOption = None,
    window: Annotated[
        WindowChoice | None,
        option("The last full average of each bearing, or every result [last; --json: all]"),
    ] = None,
    calibration: Annotated[
        CalibrationChoice,
        typer.Option(help="Convert counts with the recorded calibration or the plant file's."),
    ] = CalibrationChoice.RECORDED,
    json_output: Annotated[
        bool, typer.Option("--json", help="Print a JSON array of assessments instead of tables.")
    ] = False,
) -> None:
    """Analyse a recording with the bearings and the analysis settings of a plant file.

    The unit is the recorded one unless --unit names another of the plant file.
    """
    plant_file = load_plant_file(plant)
    choice = window or (WindowChoice.ALL if json_output else WindowChoice.LAST)
    return_large_pieces()
    opened = open_recording(recording)
    settings = one_unit(plant_file, unit or opened.manifest.unit, plant)
    selection = selection_of(opened, settings)
    ids = [channel.id for channel in settings.channel]
    configured = calibration_of(settings)
    for difference in calibration_differences(ids, selection.calibration, configured):
        typer.echo(f"{recording}: {difference}; the {calibration} calibration is used", err=True)
    if calibration is CalibrationChoice.PLANT:
        selection = replace(selection, calibration=configured)
    source = RecordingSource(opened, SystemClock(), selection, block_s=BLOCK_S)
    machine = replace(machine_of(settings), rate_hz=opened.manifest.rate_hz)
    monitor = UnitMonitor(machine, analysis_of(plant_file.analysis))
    found = _chosen(source, monitor, choice, opened.manifest.n_samples)
    if not uvloop.run(_print(found, json_output)):
        n_samples = plant_file.analysis.segment_samples
        fail(f"{recording}: no result, because no {n_samples} consecutive samples are without gap")


async def _chosen(
    source: SampleSource, monitor: UnitMonitor, choice: WindowChoice, n_samples: int
) -> AsyncIterator[Assessment]:
    last = LastAverages()
    with progress("Analysing", n_samples) as bar:
        async for refresh in refreshes(source, monitor, bar.update):
            if choice is WindowChoice.ALL:
                yield refresh.assessment()
            else:
                last.put(refresh)
    for refresh in last.all():
        yield refresh.assessment()


async def _print(found: AsyncIterator[Assessment], json_output: bool) -> int:
    n_printed = 0
    async for assessment in found:
        if json_output:
            before = ",\n" if n_printed else "[\n"
            document = to_json(assessment_document(assessment), inf_nan_mode="null").decode()
            typer.echo(before + document, nl=False)
        else:
            typer.echo("\n".join(_table(assessment)))
        n_printed += 1
    if json_output:
        typer.echo("\n]" if n_printed else "[]")
    return n_printed


def _table(assessment: Assessment) -> Iterator[str]:
    found, document = assessment.window, assessment_document(assessment)
    segments = f"{found.n_segments} of {found.n_segments_wanted} segments"
    yield (
        f"\n{assessment.unit} {assessment.bearing}, {rfc3339(assessment.time_ns)},"
        f" {segments}{'' if is_full(found) else ' (not a full average)'},"
        f" {found.duration_s:.1f} s, {document['quality'].level}"
    )
    yield from (f"  {line}" for line in stiffness_lines(assessment))
    for name, reading in document["readings"].items():
        if name.startswith("stiffness_"):
            continue
        value = "—" if reading.value is None else f"{reading.value:.6g}"
        doubt = "" if reading.level == "good" else f"  {reading.level}: {reading.reason}"
        quantity = quantity_of(name)
        yield f"  {quantity.label:<48}{value:>14} {quantity.unit:<10}{doubt}".rstrip()
