"""`padwatch reanalyse`: the analysis of a recording, the same as live."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer
import uvloop

from acquisition.clock import SystemClock
from acquisition.errors import AcquisitionError
from acquisition.source import SampleSource
from core.monitor.assessment import Assessment
from core.monitor.monitor import UnitMonitor
from service.app.recordings import recording_of, recording_source, selection_of
from service.cli.offline.reanalysis import (
    LastAverages,
    assessment_model,
    calibration_differences,
    is_full,
    refreshes,
)
from service.cli.options import UnitOption, fail, one_unit, read_plant_file
from service.runtime.process import return_large_pieces
from service.runtime.times import rfc3339
from service.settings.core_values import analysis_of, calibration_of, machine_of


class WindowChoice(StrEnum):
    """Which results are printed."""

    LAST = "last"
    ALL = "all"


class CalibrationChoice(StrEnum):
    """How counts become engineering units."""

    RECORDED = "recorded"
    PLANT = "plant"


def reanalyse(
    recording: Annotated[Path, typer.Argument(help="Folder of the recording.")],
    plant: Annotated[Path, typer.Option(help="The plant file (TOML).", show_default=False)],
    unit: UnitOption = None,
    window: Annotated[
        WindowChoice | None,
        typer.Option(
            help="The last full average of each bearing, or every result [last; --json: all]",
            show_default=False,
        ),
    ] = None,
    calibration: Annotated[
        CalibrationChoice,
        typer.Option(help="Read the counts as they were recorded, or by the plant file."),
    ] = CalibrationChoice.RECORDED,
    json_output: Annotated[
        bool, typer.Option("--json", help="Print a JSON array of assessments instead of tables.")
    ] = False,
) -> None:
    """Analyse a recording with the bearings and the analysis settings of a plant file.

    The unit is the recorded one unless --unit names another of the plant file.
    """
    plant_file = read_plant_file(plant)
    choice = window or (WindowChoice.ALL if json_output else WindowChoice.LAST)
    return_large_pieces()
    try:
        opened = recording_of(recording)
        settings = one_unit(plant_file, unit or opened.manifest.unit, plant)
        selection = selection_of(opened, settings)
        by_plant = calibration is CalibrationChoice.PLANT
        source = recording_source(opened, selection, settings if by_plant else None, SystemClock())
        ids = [channel.id for channel in settings.channel]
        configured = calibration_of(settings)
        for words in calibration_differences(ids, selection.calibration, configured):
            typer.echo(f"{recording}: {words}; used is the {calibration} one", err=True)
        machine = replace(machine_of(settings), rate_hz=opened.manifest.rate_hz)
        monitor = UnitMonitor(machine, analysis_of(plant_file.analysis))
        printer = JsonPrinter() if json_output else TextPrinter()
        found = uvloop.run(_print(source, monitor, choice, printer, opened.manifest.n_samples))
    except AcquisitionError as error:
        fail(f"padwatch reanalyse: {error}")
    if not found:
        n_samples = plant_file.analysis.segment_samples
        fail(f"{recording}: no segment of {n_samples} samples without a gap, so no result")


class TextPrinter:
    """Assessments as tables for people."""

    def put(self, assessment: Assessment) -> None:
        """Print one assessment."""
        typer.echo("\n".join(_table(assessment)))

    def end(self) -> None:
        """Print the end of the output."""


class JsonPrinter:
    """Assessments as one JSON array, printed as they come."""

    def __init__(self) -> None:
        self._before = "[\n"

    def put(self, assessment: Assessment) -> None:
        """Print one assessment."""
        typer.echo(self._before + assessment_model(assessment).model_dump_json(), nl=False)
        self._before = ",\n"

    def end(self) -> None:
        """Print the end of the output."""
        typer.echo("[]" if self._before == "[\n" else "\n]")


async def _print(
    source: SampleSource,
    monitor: UnitMonitor,
    choice: WindowChoice,
    printer: TextPrinter | JsonPrinter,
    n_samples: int,
) -> bool:
    """Print the chosen results; return whether there were any."""
    last, found = LastAverages(), False
    with typer.progressbar(
        length=n_samples, label="Analysing", file=sys.stderr, hidden=not sys.stderr.isatty()
    ) as bar:
        async for refresh in refreshes(source, monitor, bar.update):
            found = True
            if choice is WindowChoice.ALL:
                printer.put(refresh.assessment())
            else:
                last.put(refresh)
    for refresh in last.all():
        printer.put(refresh.assessment())
    printer.end()
    return found


def _table(assessment: Assessment) -> Iterator[str]:
    found = assessment.window
    segments = f"{found.n_segments} of {found.n_segments_wanted} segments"
    yield (
        f"\n{assessment.unit} {assessment.bearing}, {rfc3339(assessment.time_ns)},"
        f" {segments}{'' if is_full(found) else ' (not a full average)'},"
        f" {found.duration_s:.1f} s, {assessment_model(assessment).quality.level}"
    )
    for reading in assessment_model(assessment).readings.values():
        value = "—" if reading.value is None else f"{reading.value:.6g}"
        doubt = "" if reading.level == "good" else f"  {reading.level}: {reading.reason}"
        yield f"  {reading.label:<48}{value:>14} {reading.unit:<10}{doubt}".rstrip()
