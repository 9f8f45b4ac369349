"""`padwatch backup` and `padwatch restore`: verified copies of the database."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.app.stores import database_path, store_name
from service.cli.access import access_of
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.settings.plant import PlantFile
from service.store.backup import AccessAfter, BackupError, access_before, back_up, take_back
from service.store.backup import restore as put_back

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
    """Put a copy in the database's place, while padwatch is stopped; the old one is kept beside.

    Logins end, and keys that have been revoked since the copy was made are revoked again. Accounts
    and their passwords are those of the copy.
    """
    plant = read_plant_file(plant_file)
    database, now_ns = _file("restore", plant), SystemClock().now_ns()
    access = access_before(database)
    try:
        done = put_back(copy, database, now_ns)
    except BackupError as error:
        fail(f"padwatch restore: {error}")
    with access_of(plant, "padwatch restore") as restored:
        after = take_back(restored, access, now_ns)
    before = None if done.before is None else str(done.before)
    found = {"database": str(done.database), "before": before, "schema": done.content.schema}
    if json_output:
        typer.echo(json.dumps(found | {"access": asdict(after)}))
        return
    typer.echo(f"{done.database}: restored" + (f"; what was there is {before}" if before else ""))
    for line in _access_lines(after):
        typer.echo(line)


def _access_lines(after: AccessAfter) -> Iterator[str]:
    """Who and what can come in now: what is not named here would be found out too late."""
    yield f"all logins are ended; accounts, with passwords of then: {_listed(after.accounts)}"
    if after.returned:
        names = _listed(after.returned)
        yield f"accounts that were not there before: {names} (padwatch users remove)"
    yield f"keys that are valid: {_listed(after.keys)} (padwatch keys revoke)"
    if after.revoked:
        yield f"keys that were revoked since, and are again: {_listed(after.revoked)}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"


def _file(command: str, plant: PlantFile) -> Path:
    """The plant's database file; a database of a server is copied by the server's own tools."""
    if plant.store.postgresql is not None:
        fail(
            f"padwatch {command}: {store_name(plant)} is copied with pg_dump or pg_basebackup and"
            " put back with pg_restore: docs/how-to/postgresql.md shows how"
        )
    return database_path(plant)
