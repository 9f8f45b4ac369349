"""`padwatch readings`: the readings of the films out of the store."""

from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.app.stores import has_store, open_store, store_name
from service.cli.offline.back_test.arguments import time_ns_of
from service.cli.offline.back_test.stored import SUFFIXES, ReadingsFile, stored_histories, table_of
from service.cli.plant_file import PlantPath, fail, read_plant_file
from service.settings.film_rules import watched_estimator
from service.settings.plant import PlantFile
from service.store.film_port import FilmStore
from service.store.port import StoreError

app = typer.Typer(no_args_is_help=True, help="Readings of the films, out of the store.")

Time = Annotated[str | None, typer.Option(help="Such as 2025-01-01T00:00:00Z.", show_default=False)]


@app.callback()
def readings() -> None:
    """Readings of the films, out of the store."""


@app.command()
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
    """Write all films; how many readings each has."""
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
