"""`padwatch recording check`: all recordings of a plant, held against their index."""

import json
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.app.stores import has_store, open_store
from service.app.waveforms import custody_of
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.recordings.folders import place_of
from service.recordings.index import Found, RecordingCheck, Verdict
from service.settings.plant import PlantFile
from service.store.port import StoreError
from service.store.waveform_port import WaveformFile, WaveformKind

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
