"""`padwatch backup`, `restore`, `store check` and `readings export`."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from acquisition.clock import SystemClock
from service.app.storage import access_path, database_path, store_name
from service.cli.accounts import access_of
from service.cli.offline.backtest import time_ns_of
from service.cli.offline.backtest_files import SUFFIXES, readings_file, stored_histories, table_of
from service.cli.options import (
    JsonOutput,
    PlantPath,
    argument,
    command_group,
    fail,
    option,
    plant_store,
    print_result,
    progress,
)
from service.settings.core_values import watched_estimator
from service.settings.plant import PlantFile, load_plant_file
from service.store.backup import (
    AccessAfter,
    access_before,
    back_up,
    backup_beside,
    checked,
    revoke_again,
)
from service.store.backup import restore as put_back
from service.store.films import FilmStore
from service.store.port import StoreError
from service.store.sqlite.checking import Finding, findings


def backup(
    plant_file: PlantPath,
    folder: Annotated[Path, argument("Folder of the copies.")],
    keep: Annotated[int, typer.Option(min=1, max=10_000, help="Number of copies to keep.")] = 14,
    json_output: JsonOutput = False,
) -> None:
    """Copy the databases of results and accounts, also while padwatch runs; verify the copies.

    The names of the copies begin with `padwatch-` and `access-`; the oldest copies are removed.
    Samples, evidence and the plant file are plain files that any tool can copy.
    """
    plant, now_ns = load_plant_file(plant_file), SystemClock().now_ns()
    copies = [back_up(_file(plant), folder, now_ns, keep)]
    if access_path(plant).exists():
        copies.append(back_up(access_path(plant), folder, now_ns, keep, None))
    found = [
        {
            "backup": str(made.path),
            "n_bytes": made.n_bytes,
            "schema": made.content.schema,
            "n_rows": dict(made.content.n_rows),
            "removed": [str(path) for path in made.removed],
        }
        for made in copies
    ]
    lines = [
        f"{made.path}: verified, {made.n_bytes} bytes, {sum(made.content.n_rows.values())} rows,"
        f" schema {made.content.schema}"
        for made in copies
    ]
    print_result(found, lines, json_output, indent=None)


def restore(
    plant_file: PlantPath,
    copy: Annotated[Path, argument("A copy made by `padwatch backup`.")],
    json_output: JsonOutput = False,
) -> None:
    """Replace the databases by copies while padwatch is stopped; the old databases are kept.

    Accounts and their passwords are restored from the `access-` copy that was made with the given
    copy; all sessions end, and keys that were revoked after the copy was made are revoked again.
    Without an `access-` copy, the accounts do not change.
    """
    plant = load_plant_file(plant_file)
    database, now_ns = _file(plant), SystemClock().now_ns()
    of_access, after = backup_beside(copy, access_path(plant).stem), None
    if of_access is not None:
        checked(of_access, None)  # before anything is replaced
    done = [put_back(copy, database, now_ns)]
    if of_access is not None:
        access = access_before(access_path(plant))
        done.append(put_back(of_access, access_path(plant), now_ns, None))
        with access_of(plant) as restored:
            after = revoke_again(restored, access, now_ns)
    found = [
        {
            "database": str(each.database),
            "before": None if each.before is None else str(each.before),
            "schema": each.content.schema,
        }
        for each in done
    ]
    lines = [
        f"{each.database}: restored"
        + (f"; the former database is {each.before}" if each.before else "")
        for each in done
    ]
    lines += _access_lines(after) if after else ["no copy of the accounts: they stay as they are"]
    print_result({"restored": found, "access": after}, lines, json_output, indent=None)


def _access_lines(after: AccessAfter) -> Iterator[str]:
    yield f"all sessions are ended; accounts, with passwords of the copy: {_listed(after.accounts)}"
    if after.returned:
        names = _listed(after.returned)
        yield f"accounts that did not exist before: {names} (padwatch users remove)"
    yield f"valid keys: {_listed(after.keys)} (padwatch keys revoke)"
    if after.revoked:
        yield f"keys revoked since the copy, and revoked again: {_listed(after.revoked)}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) or "none"


def _file(plant: PlantFile) -> Path:
    """Return the plant's database file; PostgreSQL is copied by its own tools."""
    if plant.store.postgresql is not None:
        fail(
            f"{store_name(plant)} must be copied with pg_dump or pg_basebackup and restored with"
            " pg_restore; see docs/how-to/postgresql.md"
        )
    return database_path(plant)


store_app = command_group("The databases: integrity check.")

MAX_LINES = 50
STEPS = 1000


@store_app.command()
def check(plant_file: PlantPath, json_output: JsonOutput = False) -> None:
    """Read both databases from end to end; exit code 1 if anything is damaged or missing.

    The service may keep running. Checks the structure of each file, the checksum of every row,
    missing rows, and whether the database is the one that was used last. Changes nothing.
    """
    plant = load_plant_file(plant_file)
    if plant.store.postgresql is not None:
        fail(
            f"{store_name(plant)} must be checked by PostgreSQL; enable its data checksums"
            " (SHOW data_checksums) and run pg_amcheck"
        )
    files: dict[str, dict[str, object]] = {}
    lines: list[str] = []
    for path in (database_path(plant), access_path(plant)):
        with progress(f"Checking {path.name}", STEPS) as bar:
            found = list(findings(path, lambda share: bar.update(int(STEPS * share) - bar.pos)))
        files[path.name] = {"is_whole": not found, "findings": found}
        lines += _lines(str(path.absolute()), found)
    are_whole = all(each["is_whole"] for each in files.values())
    print_result({"is_whole": are_whole, "files": files}, lines, json_output)
    if not are_whole:
        raise typer.Exit(1)


def _lines(name: str, found: Sequence[Finding]) -> Iterator[str]:
    if not found:
        yield f"{name}: whole"
        return
    for finding in found[:MAX_LINES]:
        yield f"{finding.kind}: {finding.detail}"
    if len(found) > MAX_LINES:
        yield f"and {len(found) - MAX_LINES} more"
    counts = Counter(finding.kind for finding in found)
    summary = ", ".join(f"{n} {kind}" for kind, n in sorted(counts.items()))
    yield f"{name}: CORRUPT: {summary}"


readings_app = command_group("Export the stored readings of the films.")

Time = Annotated[str | None, option("Time such as 2025-01-01T00:00:00Z.")]


@readings_app.command()
def export(
    plant_file: PlantPath,
    out: Annotated[Path, argument("File to write, .csv or .parquet.")],
    start: Time = None,
    end: Time = None,
) -> None:
    """Write the stored readings of all films to a file that `padwatch backtest` reads."""
    plant = load_plant_file(plant_file)
    if out.suffix not in SUFFIXES:
        fail(f"{out}: the name of the file must end in {' or '.join(SUFFIXES)}", code=2)
    try:
        start_ns = time_ns_of(start) if start else 0
        end_ns = time_ns_of(end) if end else SystemClock().now_ns()
    except ValueError as error:
        fail(str(error), code=2)
    with plant_store(plant) as store:
        try:
            with readings_file(out) as write:
                n_readings = sum(_export(store.films, plant, write, start_ns, end_ns))
                if not n_readings:
                    raise StoreError(
                        f"{store_name(plant)}: no film readings in this time range; choose another"
                    )
        except OSError as error:
            fail(f"{out}: {error.strerror}")


def _export(
    films: FilmStore, plant: PlantFile, write: Callable[[Any], None], start_ns: int, end_ns: int
) -> Iterator[int]:
    for unit in plant.unit:
        for bearing in unit.bearing:
            place, estimator = (unit.id, bearing.id), watched_estimator(unit, bearing)
            n_readings = n_simulated = 0
            for found in stored_histories(films, place, estimator, start_ns, end_ns):
                write(table_of(place, found))
                n_readings += len(found)
                n_simulated += int(found.is_simulated.sum())
            simulated = f", {n_simulated} of them simulated" if n_simulated else ""
            typer.echo(f"{unit.id} {bearing.id}: {n_readings} readings, {estimator}{simulated}")
            yield n_readings
