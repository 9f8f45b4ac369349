"""`padwatch backup`, `restore`, `store check` and `readings export`."""

import json
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.app.storage import database_path, has_store, open_store, store_name
from service.cli.accounts import access_of
from service.cli.offline.backtest import time_ns_of
from service.cli.offline.backtest_files import SUFFIXES, ReadingsFile, stored_histories, table_of
from service.cli.options import PlantPath, fail, read_plant_file
from service.settings.core_values import watched_estimator
from service.settings.plant import PlantFile
from service.store.backup import AccessAfter, BackupError, access_before, back_up, revoke_again
from service.store.backup import restore as put_back
from service.store.films import FilmStore
from service.store.port import StoreError
from service.store.sqlite.checking import Finding, findings

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
        after = revoke_again(restored, access, now_ns)
    before = None if done.before is None else str(done.before)
    found = {"database": str(done.database), "before": before, "schema": done.content.schema}
    if json_output:
        typer.echo(json.dumps(found | {"access": asdict(after)}))
        return
    typer.echo(f"{done.database}: restored" + (f"; what was there is {before}" if before else ""))
    for line in _access_lines(after):
        typer.echo(line)


def _access_lines(after: AccessAfter) -> Iterator[str]:
    """Yield the accounts and keys that are valid after the restore."""
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
    """Return the plant's database file; PostgreSQL is copied by its own tools."""
    if plant.store.postgresql is not None:
        fail(
            f"padwatch {command}: {store_name(plant)} is copied with pg_dump or pg_basebackup and"
            " put back with pg_restore: docs/how-to/postgresql.md shows how"
        )
    return database_path(plant)


store_app = typer.Typer(no_args_is_help=True, help="The database: whether it is whole.")

MAX_LINES = 50
STEPS = 1000


@store_app.callback()
def store() -> None:
    """Keep `check` a command of its own."""


@store_app.command()
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


readings_app = typer.Typer(no_args_is_help=True, help="Readings of the films, out of the store.")

Time = Annotated[str | None, typer.Option(help="Such as 2025-01-01T00:00:00Z.", show_default=False)]


@readings_app.callback()
def readings() -> None:
    """Readings of the films, out of the store."""


@readings_app.command()
def export(
    plant_file: PlantPath,
    out: Annotated[
        Path, typer.Argument(help="File to write, .csv or .parquet.", show_default=False)
    ],
    start: Time = None,
    end: Time = None,
) -> None:
    """Write the readings that decisions were made of, as `padwatch backtest` takes them."""
    plant = read_plant_file(plant_file)
    if out.suffix not in SUFFIXES:
        fail(f"padwatch readings export: {out}: must end in {' or '.join(SUFFIXES)}", code=2)
    try:
        start_ns = time_ns_of(start) if start else 0
        end_ns = time_ns_of(end) if end else SystemClock().now_ns()
    except ValueError as error:
        fail(f"padwatch readings export: {error}", code=2)
    if not has_store(plant):
        fail(f"padwatch readings export: {store_name(plant)}: there is no database")
    try:
        with closing(open_store(plant)) as store, ReadingsFile(out) as file:
            n_readings = sum(_export(store.films, plant, file, start_ns, end_ns))
            if not n_readings:
                raise StoreError(f"{store_name(plant)}: has no readings of films in this time")
    except StoreError as error:
        fail(f"padwatch readings export: {error}")
    except OSError as error:
        fail(f"padwatch readings export: {out}: {error.strerror}")


def _export(
    films: FilmStore, plant: PlantFile, file: ReadingsFile, start_ns: int, end_ns: int
) -> list[int]:
    """Write the readings of all films; return their numbers."""
    counts = []
    for unit in plant.unit:
        for bearing in unit.bearing:
            place, estimator = (unit.id, bearing.id), watched_estimator(unit, bearing)
            n_readings = n_simulated = 0
            for found in stored_histories(films, place, estimator, start_ns, end_ns):
                file.write(table_of(place, found))
                n_readings += len(found)
                n_simulated += int(found.is_simulated.sum())
            said = f", {n_simulated} of them simulated" if n_simulated else ""
            typer.echo(f"{unit.id} {bearing.id}: {n_readings} readings, {estimator}{said}")
            counts.append(n_readings)
    return counts
