"""`padwatch backup` and `padwatch restore`: verified copies of the database."""

import json
from pathlib import Path
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.backup.backing_up import back_up
from service.backup.check import BackupError
from service.backup.restoring import restore as put_back
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.settings.plant import PlantFile
from service.wiring.stores import database_path, store_name

Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


def backup(
    plant_file: PlantPath,
    folder: Annotated[Path, typer.Argument(help="Folder of the copies.", show_default=False)],
    keep: Annotated[int, typer.Option(min=1, max=10_000, help="Copies that are kept.")] = 14,
    json_output: Json = False,
) -> None:
    """Copy the database, also while padwatch runs; verify the copy and remove the oldest ones.

    Samples, evidence and the plant file are plain files that any tool can copy.
    """
    database = _file("backup", read_plant_file(plant_file))
    try:
        made = back_up(database, folder, SystemClock().now_ns(), keep)
    except BackupError as error:
        fail(f"padwatch backup: {error}")
    n_rows = sum(made.content.n_rows.values())
    found = {
        "backup": str(made.path),
        "n_bytes": made.n_bytes,
        "schema": made.content.schema,
        "n_rows": dict(made.content.n_rows),
        "removed": [str(path) for path in made.removed],
    }
    said = f"{made.path}: verified, {made.n_bytes} bytes, {n_rows} rows, schema {found['schema']}"
    typer.echo(json.dumps(found) if json_output else said)


def restore(
    plant_file: PlantPath,
    copy: Annotated[
        Path, typer.Argument(help="A copy made by `padwatch backup`.", show_default=False)
    ],
    json_output: Json = False,
) -> None:
    """Put a copy in the database's place, while padwatch is stopped; the old one is kept beside."""
    database = _file("restore", read_plant_file(plant_file))
    try:
        done = put_back(copy, database, SystemClock().now_ns())
    except BackupError as error:
        fail(f"padwatch restore: {error}")
    before = None if done.before is None else str(done.before)
    found = {"database": str(done.database), "before": before, "schema": done.content.schema}
    said = f"{done.database}: restored" + (f"; what was there is {before}" if before else "")
    typer.echo(json.dumps(found) if json_output else said)


def _file(command: str, plant: PlantFile) -> Path:
    """The plant's database file; a database of a server is copied by the server's own tools."""
    if plant.store.postgresql is not None:
        fail(
            f"padwatch {command}: {store_name(plant)} is copied with pg_dump or pg_basebackup and"
            " put back with pg_restore: docs/how-to/postgresql.md shows how"
        )
    return database_path(plant)
