"""Readings of a film as a table: a row for each reading, columns for both directions."""

from collections.abc import Iterator

from service.api.film_series_models import FilmReadingsModel, FilmSeriesModel
from service.api.tables import Column, ColumnKind
from service.store.film_port import FilmHistory

UNITS = {
    "_n_per_m": "N/m",
    "_um_pk": "µm 0-pk",
    "_percent": "%",
    "_rpm": "r/min",
    "_mw": "MW",
    "_ratio": "1",
    "_deg": "deg",
    "_c": "°C",
}
"""By the end of a name."""

SHARED: dict[str, ColumnKind] = {
    "provenance": "text",
    "operating_state": "text",
    "is_settled": "flag",
    "speed_rpm": "number",
    "power_mw": "number",
    "eccentricity_ratio": "number",
    "attitude_deg": "number",
    "oil_temperature_c": "number",
    "baseline_version": "count",
}

OWN: dict[str, ColumnKind] = {
    "stiffness_n_per_m": "number",
    "u_random_n_per_m": "number",
    "shaft_um_pk": "number",
    "bearing_um_pk": "number",
    "evidence": "text",
    "verdict": "text",
    "level": "text",
    "change_percent": "number",
    "deviation_percent": "number",
}


def film_table(model: FilmReadingsModel, found: FilmHistory, rows: list[int]) -> list[Column]:
    """Columns of readings.

    Parameters
    ----------
    rows
        Those of the history that the model has.
    """
    times = found.history.time_ns[rows].tolist()
    shared = [Column(n, kind, getattr(model, n), _unit(n)) for n, kind in SHARED.items()]
    return [Column("time_utc", "time", times), *shared, *_side("x", model.x), *_side("y", model.y)]


def _side(direction: str, series: FilmSeriesModel) -> Iterator[Column]:
    for name, kind in OWN.items():
        yield Column(f"{direction}_{name}", kind, getattr(series, name), _unit(name))


def _unit(name: str) -> str | None:
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), None)
