"""`padwatch store`: whether what is stored is what was stored."""

import json
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import Annotated

import typer

from service.app.stores import database_path, store_name
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.settings.plant import PlantFile
from service.store.port import StoreError
from service.store.sqlite.checking import Finding, findings

app = typer.Typer(no_args_is_help=True, help="The database: whether it is whole.")

MAX_LINES = 50
STEPS = 1000


@app.callback()
def store() -> None:
    """Keep `check` a command of its own."""


@app.command()
def check(
    plant_file: PlantPath,
    json_output: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Read the database from end to end; exit code 1 if anything is damaged or missing.

    The service may go on running. Looks at the structure of the file, at the seal of every row, for
    rows that are gone, and whether the database is the one that was here last. Changes nothing.
    """
    plant = read_plant_file(plant_file)
    if plant.store.postgresql is not None:
        fail(
            f"padwatch store check: {store_name(plant)} is looked after by PostgreSQL: have its"
            " data checksums on (SHOW data_checksums) and check it with pg_amcheck"
        )
    try:
        found = _found(plant)
    except StoreError as error:
        fail(f"padwatch store check: {error}")
    if json_output:
        document = {"is_whole": not found, "findings": [asdict(finding) for finding in found]}
        typer.echo(json.dumps(document, indent=1))
    else:
        typer.echo("\n".join(_lines(plant, found)))
    if found:
        raise typer.Exit(1)


def _found(plant: PlantFile) -> list[Finding]:
    hidden = not sys.stderr.isatty()
    with typer.progressbar(length=STEPS, label="Checking", file=sys.stderr, hidden=hidden) as bar:
        return list(
            findings(database_path(plant), lambda share: bar.update(int(STEPS * share) - bar.pos))
        )


def _lines(plant: PlantFile, found: Sequence[Finding]) -> list[str]:
    if not found:
        return [f"{store_name(plant)}: whole"]
    lines = [f"{finding.kind}: {finding.detail}" for finding in found[:MAX_LINES]]
    if len(found) > MAX_LINES:
        lines.append(f"and {len(found) - MAX_LINES} more")
    counts = Counter(finding.kind for finding in found)
    told = ", ".join(f"{n} {kind}" for kind, n in sorted(counts.items()))
    return [*lines, f"{store_name(plant)}: NOT WHOLE: {told}"]
