"""`padwatch recording`: describe, list, verify, check, export and import recordings."""

import json
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any

import typer

from acquisition.clock import SystemClock
from acquisition.delivery.units import UNIT_OF
from acquisition.errors import AcquisitionError
from acquisition.recordings.export import ExportFormat, export_recording
from acquisition.recordings.reader import Recording
from acquisition.recordings.summary import RecordingSummary, summary_of
from service.app.recordings import recording_of
from service.app.storage import custody_of, has_store, open_store
from service.cli.offline.importing import import_recording
from service.cli.options import PlantPath, UnitOption, fail, one_unit, read_plant_file
from service.recordings.folders import place_of
from service.recordings.index import Found, RecordingCheck, Verdict
from service.runtime.process import made_by
from service.runtime.times import rfc3339
from service.settings.plant import PlantFile
from service.settings.sources.mapping import ImportMapping
from service.settings.toml_file import TomlFileError, load_toml
from service.store.port import StoreError
from service.store.waveforms import WaveformFile, WaveformKind

WRONG = (Found.DAMAGED, Found.MISSING)


def check(
    plant_file: PlantPath,
    json_output: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Read all recordings that the service keeps, and compare them with the index.

    Changes nothing; the service may go on running. Exit code 1 if a recording is damaged or
    missing. `padwatch recording verify` checks one that was made with `--out` elsewhere.
    """
    plant = read_plant_file(plant_file)
    roots = custody_of(plant).roots
    try:
        verdicts = _verdicts(plant, roots)
    except (OSError, StoreError) as error:
        fail(f"padwatch recording check: {error}")
    counts = Counter(verdict.found for verdict in verdicts)
    others = [verdict for verdict in verdicts if verdict.found is not Found.SOUND]
    if json_output:
        folders = [str(root) for root in roots.values()]
        typer.echo(json.dumps(_document(counts, others) | {"folders": folders}, indent=1))
    else:
        for verdict in others:
            words = verdict.found.value.replace("_", " ")
            typer.echo(f"{verdict.kind.value} {verdict.name}: {words}: {verdict.reason}")
        typer.echo(", ".join(f"{counts[f]} {f.value.replace('_', ' ')}" for f in Found))
        if not verdicts:
            typer.echo(
                f"no recordings in {' or '.join(map(str, roots.values()))};"
                " padwatch recording verify FOLDER checks one that was made elsewhere (--out)"
            )
    if any(verdict.found in WRONG for verdict in verdicts):
        raise typer.Exit(1)


def _verdicts(plant: PlantFile, roots: Mapping[WaveformKind, Path]) -> list[Verdict]:
    checking = RecordingCheck(roots, _index(plant), SystemClock().now_ns())
    found = []
    hidden = not sys.stderr.isatty()
    with typer.progressbar(
        length=checking.n_to_read, label="Checking", file=sys.stderr, hidden=hidden
    ) as bar:
        for verdict in checking.verdicts():
            found.append(verdict)
            bar.update(1)
    return found


def _index(plant: PlantFile) -> Sequence[WaveformFile]:
    if not has_store(plant):
        return []
    with closing(open_store(plant)) as store:
        return store.waveforms.files(place_of(Path(plant.service.data_folder)))


def _document(counts: Counter[Found], others: Sequence[Verdict]) -> dict[str, object]:
    listed = [
        {"kind": v.kind.value, "name": v.name, "found": v.found.value, "reason": v.reason}
        for v in others
    ]
    return {found.value: counts[found] for found in Found} | {"recordings": listed}


GAPS_PRINTED = 20


def json_of(recording: Recording, summary: RecordingSummary) -> dict[str, Any]:
    """Return the description of a recording as JSON."""
    manifest = recording.manifest
    return {
        "folder": str(recording.folder),
        "unit": manifest.unit,
        "version": manifest.version,
        "made_by": manifest.made_by,
        "sample_type": manifest.sample_type,
        "rate_hz": manifest.rate_hz,
        "block_samples": manifest.block_samples,
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
        "slow_channels": [channel.model_dump(mode="json") for channel in manifest.slow_channels],
        "files": {name: file.model_dump() for name, file in manifest.files.items()},
    }


def lines_of(recording: Recording, summary: RecordingSummary) -> Iterator[str]:
    """Yield the description of a recording as text."""
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
