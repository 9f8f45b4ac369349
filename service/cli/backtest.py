"""`padwatch backtest`: baseline and decision over years of readings in a file."""

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from acquisition.clock import SystemClock
from service.cli.offline.backtest import (
    Found,
    event_of,
    export_baselines,
    lines_of,
    run_back_test,
    time_ns_of,
)
from service.cli.offline.backtest_bearing import BackTestRules, Learning, places_of, rules_of
from service.cli.offline.backtest_cells import ReadingsError
from service.cli.offline.backtest_files import read_histories
from service.cli.offline.backtest_histories import BearingRows, Place
from service.cli.offline.backtest_report import BackTestReport
from service.cli.options import fail, read_plant_file
from service.runtime.process import made_by
from service.settings.films import FilmAlarmSettings
from service.settings.plant import PlantFile
from service.settings.toml_file import TomlFileError, load_toml


def backtest(
    readings: Annotated[
        Path, typer.Argument(help="Readings (CSV or Parquet).", show_default=False)
    ],
    plant: Annotated[
        Path | None,
        typer.Option(
            help="Plant file (TOML): which units and bearings there are, rated figures, brackets,"
            " settings.",
            show_default=False,
        ),
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(
            help="Settings to try (TOML): keys of the plant file's [films], instead of these.",
            show_default=False,
        ),
    ] = None,
    learn_days: Annotated[
        float | None,
        typer.Option(
            help="Days to learn from after the first reading and after each event"
            " [learning_days of the settings, 365]",
            show_default=False,
            min=1.0,
            max=36_500.0,
        ),
    ] = None,
    learn_until: Annotated[
        str | None,
        typer.Option(
            help="Learn the first baseline up to this time, such as 2025-01-01T00:00:00Z.",
            show_default=False,
        ),
    ] = None,
    event: Annotated[
        list[str] | None,
        typer.Option(
            help="A new baseline from here on: 'UNIT[/BEARING] TIME [WORDS]'; may be repeated.",
            show_default=False,
        ),
    ] = None,
    estimator: Annotated[
        str, typer.Option(help="Name of the stiffness estimator, stored with exported baselines.")
    ] = "not told",
    export: Annotated[
        Path | None,
        typer.Option(help="New folder for the learned baselines, as JSON.", show_default=False),
    ] = None,
    json_output: Annotated[
        bool, typer.Option("--json", help="Print the report as JSON instead of tables.")
    ] = False,
) -> None:
    """Learn baselines from readings of the past, and list what would have been alarmed after."""
    clock = SystemClock()
    begin_s = clock.monotonic_s()
    plant_file = read_plant_file(plant) if plant else None
    film = _settings(settings, plant_file)
    try:
        learning = Learning(
            days=learn_days or film.learning_days,
            until_ns=None if learn_until is None else time_ns_of(learn_until),
        )
        events = [event_of(text) for text in event or ()]
    except ValueError as error:
        fail(f"padwatch backtest: {error}", code=2)
    if export is not None and export.exists():
        fail(f"padwatch backtest: {export}: exists already", code=2)
    rules = rules_of(film, plant_file, learning, events, made_by(), clock.now_ns(), estimator)
    try:
        histories = _read(readings, plant_file)
        found = _run(histories, rules)
        if export is not None:
            n_files = export_baselines(found, export)
            typer.echo(f"{export}: {n_files} files", err=True)
    except ReadingsError as error:
        fail(f"padwatch backtest: {error}")
    except OSError as error:
        fail(f"padwatch backtest: {export}: {error.strerror}")
    report = _report(readings, histories, found, clock.monotonic_s() - begin_s)
    typer.echo(report.model_dump_json(indent=1) if json_output else "\n".join(lines_of(report)))


def _settings(path: Path | None, plant: PlantFile | None) -> FilmAlarmSettings:
    if path is None:
        return plant.films if plant else FilmAlarmSettings()
    try:
        return load_toml(path, FilmAlarmSettings)
    except TomlFileError as error:
        fail(str(error), code=2)


def _read(path: Path, plant: PlantFile | None) -> dict[Place, BearingRows]:
    size = path.stat().st_size if path.is_file() else 1
    with _bar("Reading", size) as bar:
        return read_histories(path, places_of(plant) if plant else None, bar.update)


def _run(histories: dict[Place, BearingRows], rules: BackTestRules) -> Found:
    with _bar("Deciding", _n_rows(histories)) as bar:
        return run_back_test(histories, rules, bar.update)


def _n_rows(histories: dict[Place, BearingRows]) -> int:
    return sum(sum(rows.n_rows) for rows in histories.values())


def _report(
    path: Path, histories: dict[Place, BearingRows], found: Found, duration_s: float
) -> BackTestReport:
    return BackTestReport(
        file=str(path),
        rows=_n_rows(histories),
        films=found.films,
        alarms=found.alarms,
        rate=found.rate(),
        doubts=found.doubts,
        duration_s=duration_s,
        readings_per_s=_n_rows(histories) / max(duration_s, 1e-9),
    )


def _bar(label: str, length: int) -> Any:
    return typer.progressbar(
        length=length, label=label, file=sys.stderr, hidden=not sys.stderr.isatty()
    )
