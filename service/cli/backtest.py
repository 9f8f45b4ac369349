"""`padwatch backtest`: learn baselines from past readings in a file, and judge later ones."""

from pathlib import Path
from typing import Annotated

import typer

from acquisition.clock import SystemClock
from service.cli.offline.backtest import (
    event_of,
    export_baselines,
    lines_of,
    run_back_test,
    time_ns_of,
)
from service.cli.offline.backtest_bearing import UNSPECIFIED, Learning, rules_of
from service.cli.offline.backtest_files import read_histories
from service.cli.options import JsonOutput, argument, fail, option, print_result, progress
from service.runtime.process import made_by
from service.settings.films import FilmAlarmSettings
from service.settings.plant import load_plant_file
from service.settings.toml_file import load_toml


def backtest(
    readings: Annotated[Path, argument("Readings (CSV or Parquet).")],
    plant: Annotated[
        Path | None,
        option("Plant file (TOML): units, bearings, rated figures, bracket stiffness, settings."),
    ] = None,
    settings: Annotated[
        Path | None,
        option("Settings to try (TOML): keys of [films] that replace the plant file's."),
    ] = None,
    learn_days: Annotated[
        float | None,
        option(
            "Days of learning after the first reading and after each event"
            " [learning_days of the settings, 365]",
            min=1.0,
            max=36_500.0,
        ),
    ] = None,
    learn_until: Annotated[
        str | None,
        option("Learn the first baseline up to this time, such as 2025-01-01T00:00:00Z."),
    ] = None,
    event: Annotated[
        list[str] | None,
        option(
            "Machine event that starts a new baseline: 'UNIT[/BEARING] TIME [TEXT]';"
            " may be repeated."
        ),
    ] = None,
    estimator: Annotated[
        str, typer.Option(help="Name of the stiffness estimator, stored with exported baselines.")
    ] = UNSPECIFIED,
    export: Annotated[Path | None, option("New folder for the learned baselines, as JSON.")] = None,
    json_output: JsonOutput = False,
) -> None:
    """Learn baselines from past readings, and list the alarms that would have followed.

    Changes no database; only --export writes files.
    """
    clock = SystemClock()
    begin_s = clock.monotonic_s()
    plant_file = load_plant_file(plant) if plant else None
    film = plant_file.films if plant_file else FilmAlarmSettings()
    if settings is not None:
        film = load_toml(settings, FilmAlarmSettings)
    try:
        learning = Learning(
            days=learn_days or film.learning_days,
            until_ns=None if learn_until is None else time_ns_of(learn_until),
        )
        events = [event_of(text) for text in event or ()]
    except ValueError as error:
        fail(str(error), code=2)
    if export is not None and export.exists():
        fail(f"{export}: the file or folder exists already; choose a new one", code=2)
    rules = rules_of(film, plant_file, learning, events, made_by(), clock.now_ns(), estimator)
    with progress("Reading", readings.stat().st_size if readings.is_file() else 1) as bar:
        units = plant_file.unit if plant_file else ()
        places = [(unit.id, bearing.id) for unit in units for bearing in unit.bearing]
        histories = read_histories(readings, places if plant_file else None, bar.update)
    n_rows = sum(sum(rows.n_rows) for rows in histories.values())
    with progress("Deciding", n_rows) as bar:
        found = run_back_test(histories, rules, bar.update)
    if export is not None:
        try:
            n_files = export_baselines(found, export)
        except OSError as error:
            fail(f"{export}: {error.strerror}")
        typer.echo(f"{export}: {n_files} files written", err=True)
    duration_s = clock.monotonic_s() - begin_s
    report = found.report(str(readings), n_rows, duration_s)
    print_result(report, lines_of(report), json_output)
