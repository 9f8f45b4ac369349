"""Trends page by page, as files, and what is simulated in them; the line of the shaft's centre."""

import csv
import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from core.baseline.history import StiffnessHistory
from core.condition.operating_state import OperatingState
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.quality import Reading
from service.api.tables import Column, csv_pieces, parquet_file
from service.settings.plant import PlantFile
from service.store.film_readings import FilmHistory

UJB = "/api/v1/units/U1/bearings/UJB"
START_NS = 1_767_225_600_000_000_000
WHOLE = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}
K = "stiffness_xx_n_per_m"
N = 25


@pytest.fixture(scope="module")
def stored(
    serve: Any, plant: PlantFile, database_file: Path, assessment: Callable[..., Assessment]
) -> Any:
    """A service that has stored one result a second, for tests that only read."""
    service = serve(plant, database_file)
    results = [
        assessment(
            START_NS + n * 1_000_000_000,
            stiffness_xx_n_per_m=Reading(1e9 + n, u_random=2e6, u_systematic=3e6),
            shaft_centre_x_um=Reading(10.0 + n, u_random=0.5, u_systematic=1.0),
            shaft_centre_y_um=-5.0,
            eccentricity_ratio=0.2,
            attitude_angle_deg=30.0,
        )
        for n in range(N)
    ]
    service.store.append(results, [])
    return service


async def test_pages_of_a_trend_have_every_reading_once(stored: Any) -> None:
    times, means, cursor = [], [], "first"
    while cursor is not None:
        body = await stored.json(f"{UJB}/trends", **WHOLE, quantity=K, max_points=10, cursor=cursor)
        assert body["bucket_s"] is None
        assert len(body["time"]) <= 10
        times += body["time"]
        means += body["series"][K]["mean"]
        cursor = body["next_cursor"]

    assert means == [1e9 + n for n in range(N)]
    assert times == [START_NS / 1e9 + n for n in range(N)]
    full = {"quantity": K, "max_points": N, "cursor": "first"}  # and the last
    assert (await stored.json(f"{UJB}/trends", **WHOLE, **full))["next_cursor"] is None


async def test_wrong_cursors_are_refused(stored: Any) -> None:
    for cursor in ("", "next", "-1", "1e9", "9" * 20, "first; DROP TABLE assessment"):
        problem = await stored.problem(f"{UJB}/trends", 422, **WHOLE, quantity=K, cursor=cursor)
        assert problem["errors"][0]["parameter"] == "cursor"
    groups = {"quantity": K, "cursor": "first", "group_by": "state"}
    problem = await stored.problem(f"{UJB}/trends", 422, **WHOLE, **groups)
    assert "group_by" in problem["detail"]
    beyond = await stored.json(f"{UJB}/trends", **WHOLE, quantity=K, cursor="9" * 19)
    assert (beyond["time"], beyond["next_cursor"]) == ([], None)


async def test_a_trend_is_the_same_numbers_as_csv(stored: Any) -> None:
    body = await stored.json(f"{UJB}/trends", **WHOLE, quantity=K)

    response = await stored.get(f"{UJB}/trends", **WHOLE, quantity=K, format="csv")

    assert response.headers["content-type"].startswith("text/csv")
    assert response.headers["content-disposition"] == 'attachment; filename="trends-U1-UJB.csv"'
    rows = list(csv.DictReader(io.StringIO(response.text)))
    assert [float(row[f"{K}_mean [N/m]"]) for row in rows] == body["series"][K]["mean"]
    assert {float(row[f"{K}_u_random [N/m]"]) for row in rows} == {2e6}
    assert {row[f"{K}_worst_level"] for row in rows} == {"good"}
    assert {row["is_simulated"] for row in rows} == {"False"}
    assert rows[-1]["time_utc"] == "2026-01-01T00:00:24.000Z"
    page = {"quantity": K, "max_points": 10, "cursor": "first", "format": "csv"}
    first = await stored.get(f"{UJB}/trends", **WHOLE, **page)
    assert first.headers["padwatch-next-cursor"] == str(START_NS + 10_000_000_000)
    await stored.problem(f"{UJB}/trends", 422, **WHOLE, quantity=K, format="xlsx")


async def test_a_trend_is_a_parquet_file_where_that_is_accepted(stored: Any) -> None:
    body = await stored.json(f"{UJB}/trends", **WHOLE, quantity=K, max_points=10)
    accepted = {"accept": "application/vnd.apache.parquet;q=1, */*"}

    response = await stored.client.get(
        f"{UJB}/trends", params={**WHOLE, "quantity": K, "max_points": 10}, headers=accepted
    )

    table = pq.read_table(io.BytesIO(response.content))
    assert table[f"{K}_minimum"].to_pylist() == body["series"][K]["min"]
    assert table[f"{K}_count"].to_pylist() == body["series"][K]["count"]
    assert table.schema.field(f"{K}_mean").metadata == {b"unit": b"N/m"}
    assert [t.timestamp() for t in table["time_utc"].to_pylist()] == body["time"]


async def test_groups_are_below_each_other_in_a_file(
    service: Any, assessment: Callable[..., Assessment]
) -> None:
    for n, eccentricity in enumerate((0.31, 0.36, 0.37)):
        values = {K: 1e9 + n, "eccentricity_ratio": eccentricity}
        service.store.append([assessment(START_NS + n * 1_000_000_000, **values)], [])

    response = await service.get(
        f"{UJB}/trends", **WHOLE, quantity=K, group_by="eccentricity", format="csv"
    )

    rows = list(csv.DictReader(io.StringIO(response.text)))
    assert [(row["group"], float(row[f"{K}_mean [N/m]"]) - 1e9) for row in rows] == [
        ("0.3 to 0.35", 0.0),
        ("0.35 to 0.4", 1.0),
        ("0.35 to 0.4", 2.0),
    ]


def test_a_csv_file_has_every_row_and_no_text_of_it_is_a_formula() -> None:
    texts = ['=HYPERLINK("http://x")', "+1", "-1", "@SUM(A1)", "\tx", "plain, with comma"]
    columns = [Column("=note", "text", texts), Column("x", "number", [-1.5] * 6, "µm")]

    rows = list(csv.reader(io.StringIO(b"".join(csv_pieces(columns)).decode(), newline="")))

    assert rows[0] == ["'=note", "x [µm]"]
    assert [row[0] for row in rows[1:]] == [*("'" + text for text in texts[:-1]), texts[-1]]
    assert rows[1][1] == "-1.5"
    for n in (0, 499, 500, 501, 1000):  # no row is lost between pieces
        pieces = list(csv_pieces([Column("n", "count", range(n))]))
        assert b"".join(pieces).decode().split() == ["n", *map(str, range(n))]
    assert pq.read_table(io.BytesIO(parquet_file([Column("n", "number", [None])]))).num_rows == 1


async def test_the_centre_line_has_position_and_uncertainty_by_column(stored: Any) -> None:
    body = await stored.json(f"{UJB}/shaft-centre", **WHOLE)

    assert body["x_um"]["mean"] == [10.0 + n for n in range(N)]
    assert body["x_um"]["u_random"] == [0.5] * N
    assert body["y_um"]["mean"] == [-5.0] * N
    assert body["eccentricity_ratio"]["mean"] == [0.2] * N
    assert body["attitude_angle_deg"]["worst_level"] == ["good"] * N
    assert body["clearance_um"] == 200.0
    assert body["simulated_until"] is None
    assert len(body["time"]) == N
    await stored.problem("/api/v1/units/U1/bearings/XJB/shaft-centre", 404, **WHOLE)


def simulated_past(n: int) -> FilmHistory:
    """One reading a second from the start on, all healthy."""
    one, two = np.ones(n), np.ones((2, n))
    history = StiffnessHistory(
        time_ns=START_NS + np.arange(n) * 1_000_000_000,
        speed_rpm=one,
        power_mw=one,
        eccentricity_ratio=0.3 * one,
        u_eccentricity=0.01 * one,
        attitude_deg=one,
        oil_temperature_c=one,
        ln_k=20.0 * two,
        u_random=0.01 * two,
        shaft_um_pk=two,
        bearing_um_pk=two,
    )
    nothing, codes = np.full((2, n), np.nan), np.zeros((2, n), np.int8)
    state, flags = np.full(n, OperatingState.FULL_LOAD, np.int8), np.ones(n, bool)
    version = np.zeros(n, np.int64)
    numbers = (nothing, nothing, nothing, nothing)
    return FilmHistory(history, state, flags, flags, codes, codes, *numbers, version)


async def test_what_is_simulated_is_said_as_long_as_it_is_in_the_range(
    service: Any, assessment: Callable[..., Assessment]
) -> None:
    films = simulated_past(11)
    service.store.films.add_past("U1", "UJB", Estimator.DYNAMIC, films, {K: np.full(11, 1e9)})
    measured = assessment(START_NS + 11_000_000_000, stiffness_xx_n_per_m=1e9)
    service.store.append([measured], [])
    later = WHOLE | {"start": "2026-01-01T00:00:11Z"}

    for what in ("trends", "shaft-centre"):
        asked = {"quantity": K} if what == "trends" else {}
        body = await service.json(f"{UJB}/{what}", **WHOLE, **asked)
        assert len(body["time"]) == 12
        assert body["simulated_until"] == "2026-01-01T00:00:10.000Z"
        assert (await service.json(f"{UJB}/{what}", **later, **asked))["simulated_until"] is None
    file = await service.get(f"{UJB}/trends", **WHOLE, quantity=K, format="csv")
    assert [",True," in row for row in file.text.splitlines()[1:]] == [True] * 11 + [False]
