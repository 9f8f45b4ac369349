"""`padwatch recording`: describe, list, verify, check, export and import recordings."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from acquisition.clock import SystemClock
from acquisition.delivery.units import UNIT_OF
from acquisition.recordings.export import ExportFormat, export_recording
from acquisition.recordings.reader import Recording, RecordingSummary, open_recording
from service.app.kept_files import retention_rules
from service.app.storage import has_store
from service.cli.offline.importing import import_recording
from service.cli.options import (
    JsonOutput,
    NewRecording,
    PlantOption,
    PlantPath,
    RecordingFolder,
    UnitOption,
    argument,
    command_group,
    fail,
    one_unit,
    option,
    plant_store,
    print_result,
    progress,
)
from service.recordings.folders import place_of
from service.recordings.index import CheckResult, RecordingCheck, RecordingState
from service.runtime.process import made_by
from service.runtime.times import rfc3339
from service.settings.plant import PlantFile, load_plant_file
from service.settings.sources.mapping import ImportMapping
from service.settings.toml_file import load_toml
from service.store.waveforms import WaveformFile, WaveformKind

app = command_group("Inspect, verify, export and import recordings.")


@app.command()
def check(plant_file: PlantPath, json_output: JsonOutput = False) -> None:
    """Read all recordings that the service keeps, and compare them with the index.

    Changes nothing; the service may keep running. Exit code 1 if a recording is damaged or
    missing. `padwatch recording verify` checks a recording in another folder.
    """
    plant = load_plant_file(plant_file)
    roots = retention_rules(plant).roots
    try:
        verdicts = _verdicts(plant, roots)
    except OSError as error:
        fail(str(error))
    counts = Counter(verdict.found for verdict in verdicts)
    others = [verdict for verdict in verdicts if verdict.found is not RecordingState.SOUND]
    document = {
        **{found.value: counts[found] for found in RecordingState},
        "recordings": [
            {"kind": v.kind, "name": v.name, "found": v.found, "reason": v.reason} for v in others
        ],
        "folders": [str(root) for root in roots.values()],
    }
    lines = [
        f"{verdict.kind.value} {verdict.name}: {_words(verdict.found)}: {verdict.reason}"
        for verdict in others
    ]
    lines.append(", ".join(f"{counts[found]} {_words(found)}" for found in RecordingState))
    if not verdicts:
        lines.append(
            f"no recordings in {' or '.join(map(str, roots.values()))};"
            " use padwatch recording verify FOLDER for a recording in another folder"
        )
    print_result(document, lines, json_output)
    if counts[RecordingState.DAMAGED] or counts[RecordingState.MISSING]:
        raise typer.Exit(1)


def _verdicts(plant: PlantFile, roots: Mapping[WaveformKind, Path]) -> list[CheckResult]:
    index: Sequence[WaveformFile] = []
    if has_store(plant):
        with plant_store(plant) as store:
            index = store.waveforms.files(place_of(Path(plant.service.data_folder)))
    checking = RecordingCheck(roots, index, SystemClock().now_ns())
    found = []
    with progress("Checking", checking.n_to_read) as bar:
        for verdict in checking.results():
            found.append(verdict)
            bar.update(1)
    return found


def _words(found: RecordingState) -> str:
    return found.value.replace("_", " ")


GAPS_PRINTED = 20
DESCRIBED = {
    *("unit", "version", "made_by", "sample_type", "rate_hz", "block_samples"),
    *("slow_channels", "files"),
}
"""Fields of the manifest in the description of a recording."""


def json_of(recording: Recording, summary: RecordingSummary) -> dict[str, Any]:
    """Return the description of a recording as a JSON object; times are RFC 3339 text in UTC."""
    manifest = recording.manifest
    return {
        "folder": str(recording.folder),
        **manifest.model_dump(mode="json", include=DESCRIBED),
        "start": rfc3339(summary.start_ns),
        "end": rfc3339(summary.stop_ns),
        "samples": summary.n_samples,
        "offered": summary.n_passed,
        "gaps": summary.n_gaps,
        "gap_samples": summary.n_gap_samples,
        "gap_list": [
            {
                "epoch": gap.epoch,
                "first_index": gap.first_index,
                "samples": gap.n_samples,
                "end": rfc3339(gap.stop_ns),
            }
            for gap in summary.gaps
        ],
        "rejected": dict(summary.rejected),
        "epochs": list(summary.epochs),
        "not_ok": dict(summary.n_not_ok),
        "channels": [
            channel.model_dump(mode="json") | {"unit": UNIT_OF[channel.measurand]}
            for channel in manifest.channels
        ],
    }


def lines_of(recording: Recording, summary: RecordingSummary) -> Iterator[str]:
    """Yield a description of a recording in lines of text, with its first `GAPS_PRINTED` gaps."""
    manifest = recording.manifest
    yield f"{recording.folder}: unit {manifest.unit}, {manifest.sample_type}, {manifest.made_by}"
    yield f"  from         {rfc3339(summary.start_ns)}"
    yield f"  to           {rfc3339(summary.stop_ns)}"
    duration_s = summary.n_passed / manifest.rate_hz
    yield f"  length       {duration_s:.3f} s at {manifest.rate_hz:.9g} Hz"
    yield f"  samples      {summary.n_samples} of {summary.n_passed} per channel"
    yield from _losses(summary)
    for channel in manifest.channels:
        yield f"  channel      {channel.id:<32} {UNIT_OF[channel.measurand]}"
    for slow in manifest.slow_channels:
        yield f"  slow channel {slow.id:<32} {slow.unit}"
    for name, file in manifest.files.items():
        yield f"  {name:<16} {file.size} bytes, SHA-256 {file.sha256[:12]}…"


def _losses(summary: RecordingSummary) -> Iterator[str]:
    yield f"  gaps         {summary.n_gaps}, {summary.n_gap_samples} samples"
    for gap in summary.gaps[:GAPS_PRINTED]:
        yield f"    {gap.n_samples} samples from index {gap.first_index}, to {rfc3339(gap.stop_ns)}"
    if summary.n_gaps > GAPS_PRINTED:
        yield f"    and {summary.n_gaps - GAPS_PRINTED} more"
    for reason, n_samples in summary.rejected.items():
        yield f"  rejected     {n_samples} samples: {reason}"
    if len(summary.epochs) > 1:
        yield f"  restarts     {len(summary.epochs) - 1} of the device's sample count"
    for id_, n_samples in summary.n_not_ok.items():
        yield f"  not OK       {n_samples} samples of {id_}"


@app.command()
def info(folder: RecordingFolder, json_output: JsonOutput = False) -> None:
    """Describe a recording: channels, length, gaps, restarts, rejections, checksums."""
    recording = open_recording(folder)
    summary = recording.summary
    print_result(json_of(recording, summary), lines_of(recording, summary), json_output)


@app.command()
def verify(folder: RecordingFolder, json_output: JsonOutput = False) -> None:
    """Read a whole recording and compare its checksums; exit code 1 if it is damaged."""
    recording, n_samples = open_recording(folder), 0
    with progress("Verifying", recording.manifest.n_samples) as bar:
        for block in recording.blocks():
            n_samples += block.n_samples
            bar.update(block.n_samples)
    document = {"folder": str(folder), "sound": True, "samples": n_samples}
    line = f"{folder}: intact, {n_samples} samples of each channel"
    print_result(document, [line], json_output, indent=None)


@app.command()
def export(
    folder: RecordingFolder,
    format_: Annotated[ExportFormat, option("Format of the file.", "--format")],
    out: Annotated[Path, typer.Option(help="File to write; must not exist yet.")],
) -> None:
    """Write a recording as a file for other tools: engineering units, UTC, no rows in gaps."""
    recording = open_recording(folder)
    with progress("Exporting", recording.manifest.n_samples) as bar:
        export_recording(recording, format_, out, bar.update)
    typer.echo(f"{out}: {recording.manifest.n_samples} samples of each channel")


@app.command("import")
def import_(
    file: Annotated[Path, argument("The file to import.")],
    mapping: Annotated[Path, typer.Option(help="Mapping of columns to channels (TOML).")],
    plant: PlantOption,
    out: NewRecording,
    unit: UnitOption = None,
    json_output: JsonOutput = False,
) -> None:
    """Make a recording from an MDF4, TDMS, HDF5 or CSV file, or from a CAN log.

    Units are converted exactly or refused, missing samples become gaps, nothing is resampled.
    """
    settings = one_unit(load_plant_file(plant), unit, plant)
    mapped = load_toml(mapping, ImportMapping)
    with progress("Importing", 100) as bar:

        def advanced(share: float) -> None:
            bar.update(round(100 * share) - bar.pos)

        import_recording(file, mapped, settings, out, made_by(), advanced=advanced)
    info(out, json_output)
