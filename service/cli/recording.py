"""`padwatch recording`: look into recordings, check, export and import them."""

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from acquisition.errors import AcquisitionError
from acquisition.recordings.export import ExportFormat, export_recording
from acquisition.recordings.summary import summary_of
from service.app.recordings import recording_of
from service.cli.offline.imports import import_recording
from service.cli.plant_file import fail, read_plant_file
from service.cli.recording_check import check
from service.cli.recording_listing import json_of, lines_of
from service.cli.units import UnitOption, one_unit
from service.runtime.process import made_by
from service.settings.import_mapping import ImportMapping
from service.settings.toml_file import TomlFileError, load_toml

app = typer.Typer(
    no_args_is_help=True, help="Look into recordings, check them, export and import them."
)
app.command()(check)

Folder = Annotated[Path, typer.Argument(help="Folder of the recording.", show_default=False)]
JsonOutput = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@app.command()
def info(folder: Folder, json_output: JsonOutput = False) -> None:
    """Show what is in a recording: channels, length, gaps, restarts, rejections, checksums."""
    try:
        recording = recording_of(folder)
        summary = summary_of(recording)
    except AcquisitionError as error:
        fail(f"padwatch recording info: {error}")
    if json_output:
        typer.echo(json.dumps(json_of(recording, summary), indent=1))
    else:
        typer.echo("\n".join(lines_of(recording, summary)))


@app.command()
def verify(folder: Folder, json_output: JsonOutput = False) -> None:
    """Read all of a recording: checksums, lengths and every page. Exit code 1 if it is damaged."""
    try:
        recording = recording_of(folder)
        n_samples = 0
        with _bar("Verifying", recording.manifest.n_samples) as bar:
            for block in recording.raw_blocks():
                n_samples += block.n_samples
                bar.update(block.n_samples)
    except AcquisitionError as error:
        fail(f"padwatch recording verify: {error}")
    if json_output:
        typer.echo(json.dumps({"folder": str(folder), "sound": True, "samples": n_samples}))
    else:
        typer.echo(f"{folder}: sound, {n_samples} samples of each channel")


@app.command()
def export(
    folder: Folder,
    format_: Annotated[
        ExportFormat, typer.Option("--format", help="Of the file.", show_default=False)
    ],
    out: Annotated[Path, typer.Option(help="File to write; must not exist yet.")],
) -> None:
    """Write a recording as a file for other tools: engineering units, UTC, no rows in gaps."""
    try:
        recording = recording_of(folder)
        with _bar("Exporting", recording.manifest.n_samples) as bar:
            export_recording(recording, format_, out, bar.update)
    except AcquisitionError as error:
        fail(f"padwatch recording export: {error}")
    typer.echo(f"{out}: {recording.manifest.n_samples} samples of each channel")


@app.command("import")
def import_(
    file: Annotated[Path, typer.Argument(help="The file to import.", show_default=False)],
    mapping: Annotated[Path, typer.Option(help="Which column is which channel (TOML).")],
    plant: Annotated[Path, typer.Option(help="The plant file (TOML).")],
    out: Annotated[Path, typer.Option(help="Folder of the recording; must not exist yet.")],
    unit: UnitOption = None,
    json_output: JsonOutput = False,
) -> None:
    """Make a recording of an MDF4, TDMS, HDF5 or CSV file, or of a CAN log.

    Units are converted exactly or refused, missing stretches become gaps, nothing is resampled.
    """
    settings = one_unit(read_plant_file(plant), unit, plant)
    try:
        mapped = load_toml(mapping, ImportMapping)
    except TomlFileError as error:
        fail(str(error), code=2)
    try:
        with _bar("Importing", 100) as bar:
            import_recording(
                file,
                mapped,
                settings,
                out,
                made_by(),
                advanced=lambda done: bar.update(round(100 * done) - bar.pos),
            )
        recording = recording_of(out)
        summary = summary_of(recording)
    except AcquisitionError as error:
        fail(f"padwatch recording import: {error}")
    if json_output:
        typer.echo(json.dumps(json_of(recording, summary), indent=1))
    else:
        typer.echo("\n".join(lines_of(recording, summary)))


def _bar(label: str, length: int) -> Any:
    return typer.progressbar(
        length=length, label=label, file=sys.stderr, hidden=not sys.stderr.isatty()
    )
