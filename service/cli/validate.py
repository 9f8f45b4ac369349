"""`padwatch validate`: compare the tables of the paper with padwatch's results."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import groupby
from typing import Annotated

import typer

from service.cli.offline.validation import (
    MEASURED,
    QUANTITIES,
    MeasuredRow,
    Row,
    errors,
    measured_rows,
    rounding_limits_gn_per_m,
    simulated_rows,
)

MAX_ERROR_PERCENT = 2.0
MAX_RMS_ERROR_PERCENT = 0.7
SOURCE = "Brito et al., Experimental Estimation of Journal Bearing Stiffness"


def validate(
    json_output: Annotated[
        bool, typer.Option("--json", help="Print the rows as a JSON array instead of tables.")
    ] = False,
) -> None:
    """Recompute the tables of the paper; print published and computed figures.

    Exit code 1 if a deviation exceeds its limit, or is larger than the rounding of the published
    figures explains.
    """
    simulated, measured = simulated_rows(), measured_rows()
    if json_output:
        typer.echo(json.dumps([asdict(row) for row in (*simulated, *measured)], indent=1))
    else:
        typer.echo("\n".join(_report(simulated, measured)))
    if not _passed(simulated, measured):
        raise typer.Exit(1)


def _report(simulated: list[Row], measured: list[Row]) -> Iterator[str]:
    yield f"{SOURCE}. Amplitudes in µm zero-to-peak, stiffness in GN/m."
    for table, rows in groupby(simulated, key=lambda row: row.table):
        yield from _amplitude_table(f"Table {table}", list(rows))
    summary = errors(simulated)
    yield (
        f"\nTables 4 to 7, {len(simulated)} amplitudes: largest error"
        f" {summary.max_percent:.2f} % (limit {MAX_ERROR_PERCENT} %),"
        f" rms {summary.rms_percent:.2f} % (limit {MAX_RMS_ERROR_PERCENT} %)."
    )
    for place, pairs in groupby(zip(measured, MEASURED, strict=True), lambda p: p[0].table):
        title = f"Section {place}" if isinstance(place, str) else f"Table {place}"
        yield from _stiffness_table(title, pairs)
    n_within = sum(_within_rounding(r, m) for r, m in zip(measured, MEASURED, strict=True))
    yield f"\n{n_within} of {len(measured)} stiffnesses within what the printed digits allow."


def _amplitude_table(title: str, rows: list[Row]) -> Iterator[str]:
    yield f"\n{title}, {rows[0].bearing}, 1x, model: paper / padwatch (error)"
    header = "".join(f"{name.removesuffix('_um_pk'):>24}" for name in QUANTITIES)
    yield f"{'condition':>9}{header}"
    for condition, cells in groupby(rows, key=lambda row: row.condition):
        yield f"{condition:>9}" + "".join(
            f"{row.paper:>8.1f} /{row.padwatch:>6.2f} ({row.error_percent:+.1f}%)" for row in cells
        )


def _stiffness_table(title: str, pairs: Iterable[tuple[Row, MeasuredRow]]) -> Iterator[str]:
    yield f"\n{title}, measured, X direction, equation (5)"
    yield (
        f"{'condition':<18}{'bearing':<9}{'shaft':>7}{'bearing':>9}{'paper':>8}{'padwatch':>10}"
        f"{'error':>8}  allowed by rounding"
    )
    for row, measured in pairs:
        lowest, highest = rounding_limits_gn_per_m(measured)
        yield (
            f"{row.condition:<18}{row.bearing:<9}{measured.shaft_um_pk:>7}"
            f"{measured.bearing_um_pk:>9}{measured.k_eff_gn_per_m:>8}{row.padwatch:>10.3f}"
            f"{row.error_percent:>+7.1f}%  {lowest:.3f} to {highest:.3f}"
            f" {'ok' if _within_rounding(row, measured) else 'OUTSIDE'}"
        )


def _within_rounding(row: Row, measured: MeasuredRow) -> bool:
    lowest, highest = rounding_limits_gn_per_m(measured)
    return lowest <= row.paper <= highest


def _passed(simulated: list[Row], measured: list[Row]) -> bool:
    summary = errors(simulated)
    return (
        summary.max_percent <= MAX_ERROR_PERCENT
        and summary.rms_percent <= MAX_RMS_ERROR_PERCENT
        and all(map(_within_rounding, measured, MEASURED))
    )
