"""Trends page by page and in groups, what is simulated in them, and tables as JSON has them."""

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from core.baseline.history import StiffnessHistory
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.quality import Reading
from service.api.tables import Column, csv_pieces, parquet_file
from service.runtime.times import rfc3339
from service.store.film_readings import FilmHistory

UJB = "/api/v1/units/U1/bearings/UJB"
START_NS = 1_767_225_600_000_000_000
WHOLE = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}
K = "stiffness_xx_n_per_m"
N = 25


@pytest.mark.parametrize(
    ("parameters", "n_days"),
    [({"last": "24h"}, 1), ({"last": "3d"}, 3), ({"last": "1440min"}, 1)],
    ids=str,
)
async def test_the_last_hours_end_at_the_next_whole_minute(stored, parameters, n_days):
    now_ns = stored.clock.now_ns()

    body = await stored.json(f"{UJB}/trends", **parameters, quantity=K)
    start, end = (datetime.fromisoformat(body[name]) for name in ("start", "end"))

    assert end - start == timedelta(days=n_days)
    assert (end.second, end.microsecond) == (0, 0)
    assert 0.0 < end.timestamp() - now_ns / 1e9 <= 60.0


@pytest.mark.parametrize(
    "parameters",
    [{}, {"last": "1h", "start": WHOLE["start"]}, {"last": "0h"}, {"last": "1 y"}, {"last": "٣h"}],
    ids=str,
)
async def test_a_period_without_one_clear_start_is_refused(stored, parameters):
    await stored.problem(f"{UJB}/trends", 422, **parameters, quantity=K)


@pytest.fixture(scope="module")
def stored(serve, plant, database_file, assessment) -> Any:
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
            pad_temperature_3_c=60.0 + n,
        )
        for n in range(N)
    ]
    service.store.append(results, [])
    return service


async def test_pages_of_a_trend_have_every_reading_once(stored):
    times, means, cursor = [], [], "first"
    while cursor is not None:
        body = await stored.json(f"{UJB}/trends", **WHOLE, quantity=K, max_points=10, cursor=cursor)
        assert body["bucket_s"] is None
        assert len(body["time"]) <= 10
        times += body["time"]
        means += body["series"][K]["mean"]
        cursor = body["next_cursor"]

    assert means == [1e9 + n for n in range(N)]
    assert times == [rfc3339(START_NS + n * 1_000_000_000) for n in range(N)]
    full = {"quantity": K, "max_points": N, "cursor": "first"}  # and the last
    assert (await stored.json(f"{UJB}/trends", **WHOLE, **full))["next_cursor"] is None


async def test_wrong_cursors_are_refused(stored):
    for cursor in ("", "next", "-1", "1e9", "9" * 20, "first; DROP TABLE assessment"):
        problem = await stored.problem(f"{UJB}/trends", 422, **WHOLE, quantity=K, cursor=cursor)
        assert problem["errors"][0]["parameter"] == "cursor"
    groups = {"quantity": K, "cursor": "first", "group_by": "state"}
    problem = await stored.problem(f"{UJB}/trends", 422, **WHOLE, **groups)
    assert "group_by" in problem["detail"]
    beyond = await stored.json(f"{UJB}/trends", **WHOLE, quantity=K, cursor="9" * 19)
    assert (beyond["time"], beyond["next_cursor"]) == ([], None)


async def test_a_trend_is_the_same_numbers_as_csv(stored):
    body = await stored.json(f"{UJB}/trends", **WHOLE, quantity=K)

    response = await stored.get(f"{UJB}/trends", **WHOLE, quantity=K, format="csv")

    assert response.headers["content-type"].startswith("text/csv")
    assert response.headers["content-disposition"] == 'attachment; filename="trends-U1-UJB.csv"'
    rows = list(csv.DictReader(io.StringIO(response.text)))
    assert [float(row[f"{K}_mean [N/m]"]) for row in rows] == body["series"][K]["mean"]
    assert {float(row[f"{K}_u_random [N/m]"]) for row in rows} == {2e6}
    assert {row[f"{K}_worst_level"] for row in rows} == {"good"}
    assert {row["is_simulated"] for row in rows} == {"False"}
    pad = {"quantity": "pad_temperature_3_c", "format": "csv"}
    rows = list(
        csv.DictReader(io.StringIO((await stored.get(f"{UJB}/trends", **WHOLE, **pad)).text))
    )
    assert float(rows[-1]["pad_temperature_3_c_maximum [°C]"]) == 60.0 + N - 1
    await stored.problem(f"{UJB}/trends", 422, **WHOLE, quantity="pad_temperature_3_m")
    assert rows[-1]["time_utc"] == "2026-01-01T00:00:24.000Z"
    page = {"quantity": K, "max_points": 10, "cursor": "first", "format": "csv"}
    first = await stored.get(f"{UJB}/trends", **WHOLE, **page)
    assert first.headers["padwatch-next-cursor"] == str(START_NS + 10_000_000_000)
    await stored.problem(f"{UJB}/trends", 422, **WHOLE, quantity=K, format="xlsx")


async def test_a_trend_is_a_parquet_file_where_that_is_accepted(stored):
    body = await stored.json(f"{UJB}/trends", **WHOLE, quantity=K, max_points=10)
    accepted = {"accept": "application/vnd.apache.parquet;q=1, */*"}

    response = await stored.client.get(
        f"{UJB}/trends", params={**WHOLE, "quantity": K, "max_points": 10}, headers=accepted
    )

    table = pq.read_table(io.BytesIO(response.content))
    assert table[f"{K}_minimum"].to_pylist() == body["series"][K]["minimum"]
    assert table[f"{K}_count"].to_pylist() == body["series"][K]["count"]
    assert table.schema.field(f"{K}_mean").metadata == {b"unit": b"N/m"}
    assert [t.timestamp() for t in table["time_utc"].to_pylist()] == [
        datetime.fromisoformat(time).timestamp() for time in body["time"]
    ]


async def test_groups_are_below_each_other_in_a_file(service, assessment):
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


def test_a_csv_file_has_every_row_and_no_text_of_it_is_a_formula():
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


async def test_the_line_of_the_shaft_centre_is_a_trend_of_its_coordinates(stored):
    names = ["shaft_centre_x_um", "shaft_centre_y_um", "attitude_angle_deg"]
    body = await stored.json(f"{UJB}/trends", **WHOLE, quantity=names)

    x, y, angle = (body["series"][name] for name in names)
    assert x["mean"] == [10.0 + n for n in range(N)]
    assert x["u_random"] == [0.5] * N
    assert y["mean"] == [-5.0] * N
    assert angle["worst_level"] == ["good"] * N
    assert body["simulated_until"] is None
    assert len(body["time"]) == N
    unknown = "/api/v1/units/U1/bearings/XJB/trends"
    await stored.problem(unknown, 404, **WHOLE, quantity=names)


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
    nothing, codes = np.full((4, n), np.nan), np.zeros((4, n), np.int8)
    state, flags = np.full(n, OperatingState.FULL_LOAD, np.int8), np.ones(n, bool)
    version = np.zeros(n, np.int64)
    numbers = (nothing, nothing, nothing, nothing)
    return FilmHistory(history, state, flags, flags, codes, codes, *numbers, version)


async def test_what_is_simulated_is_said_as_long_as_it_is_in_the_range(service, assessment):
    films = simulated_past(11)
    service.store.films.add_past("U1", "UJB", Estimator.DYNAMIC, films, {K: np.full(11, 1e9)})
    measured = assessment(START_NS + 11_000_000_000, stiffness_xx_n_per_m=1e9)
    service.store.append([measured], [])
    later = WHOLE | {"start": "2026-01-01T00:00:11Z"}

    body = await service.json(f"{UJB}/trends", **WHOLE, quantity=K)
    assert len(body["time"]) == 12
    assert body["simulated_until"] == "2026-01-01T00:00:10.000Z"
    after = await service.json(f"{UJB}/trends", **later, quantity=K)
    assert after["simulated_until"] is None
    file = await service.get(f"{UJB}/trends", **WHOLE, quantity=K, format="csv")
    assert [",True," in row for row in file.text.splitlines()[1:]] == [True] * 11 + [False]


HOUR_NS = 3_600_000_000_000


async def rows_of(service: Any, path: str, **asked: object) -> list[dict[str, str]]:
    response = await service.get(path, **asked, format="csv")
    assert response.status_code == 200, response.text
    assert response.headers["content-type"].startswith("text/csv")
    return list(csv.DictReader(io.StringIO(response.text, newline="")))


async def unanswered(service: Any) -> str:
    """Let an alarm be raised by a link that is lost, and shelved by somebody."""
    service.alarms.link("U1", False, "no route")
    service.clock.step(HOUR_NS)
    service.alarms.tick()
    [alarm] = [a.identity.id for a in service.alarms.alarms if a.level is not None]
    path = f"/api/v1/alarms/{alarm}/comment"
    answer = await service.client.post(path, json={"actor": "A. Name", "text": "＝1+1"})
    assert answer.status_code == 200, answer.text
    return str(alarm)


async def test_the_history_of_alarms_is_the_same_as_csv(service):
    alarm = await unanswered(service)
    events = (await service.json("/api/v1/alarms/events"))["events"]

    rows = await rows_of(service, "/api/v1/alarms/events")

    assert [row["id"] for row in rows] == [str(event["id"]) for event in events]
    assert [row["time_utc"] for row in rows] == [event["time"] for event in events]
    assert [row["change"] for row in rows] == [event["change"] for event in events]
    assert {row["alarm"] for row in rows} == {alarm}
    assert rows[0]["reason"] == "'＝1+1"  # no spreadsheet takes it for a formula
    page = await service.get("/api/v1/alarms/events", limit=1, format="csv")
    assert page.headers["padwatch-next-cursor"] == str(events[0]["id"])


async def test_the_audit_trail_is_the_same_as_csv(service):
    alarm = await unanswered(service)
    [entry] = (await service.json("/api/v1/audit"))["entries"]

    [row] = await rows_of(service, "/api/v1/audit")

    assert (entry["actor"], entry["source"], entry["peer"]) == ("A. Name", "api", "127.0.0.1")
    assert (entry["action"], entry["object"]) == ("alarm.commented", alarm)
    assert (entry["reason"], row["reason"]) == ("＝1+1", "'＝1+1")
    assert entry["before"]["state"] == entry["after"]["state"]
    assert (entry["previous_hash"], len(entry["hash"])) == ("0" * 64, 64)
    assert (row["number"], row["object"]) == ("1", alarm)
    for name in ("actor", "action", "peer", "hash", "previous_hash"):
        assert row[name] == entry[name]
    assert row["time_utc"] == entry["time"]


TRENDS = "/api/v1/units/U1/bearings/UJB/trends"
SEEN = [
    (OperatingState.PART_LOAD, 0.31, 44.0),
    (OperatingState.PART_LOAD, 0.35, 45.0),
    (OperatingState.FULL_LOAD, 0.36, 47.4),
    (OperatingState.FULL_LOAD, 0.42, 47.5),
    (OperatingState.STANDSTILL, None, 30.0),
]
"""State, eccentricity ratio and oil temperature of one result a minute."""


def store_seen(service: Any, assessment: Callable[..., Assessment]) -> Any:
    """Store results under several conditions."""
    for minute, (state, eccentricity, oil_c) in enumerate(SEEN):
        known = {} if eccentricity is None else {"eccentricity_ratio": eccentricity}
        found = assessment(
            START_NS + minute * 60_000_000_000,
            stiffness_xx_n_per_m=1e9 + minute,
            oil_temperature_c=oil_c,
            **known,
        )
        condition = BearingCondition(state, True, None)
        service.store.append([replace(found, condition=condition)], [])
    return service


@pytest.fixture(scope="module")
def seen(serve, plant, database_file, assessment) -> Any:
    """A service with these results, for tests that only read."""
    return store_seen(serve(plant, database_file), assessment)


def minutes(series: Any) -> list[int]:
    return [round(mean - 1e9) for mean in series["series"][K]["mean"] if mean is not None]


async def test_a_trend_is_of_some_states_or_has_a_series_for_each_that_there_was(seen):
    some = await seen.json(TRENDS, **WHOLE, quantity=K, state=["part_load", "standstill"])
    assert (minutes(some), some["groups"]) == ([0, 1, 4], None)

    found = await seen.json(TRENDS, **WHOLE, quantity=K, group_by="state")

    assert {group["name"]: minutes(group) for group in found["groups"]} == {
        "standstill": [4],
        "part_load": [0, 1],
        "full_load": [2, 3],
    }
    assert minutes(found) == [0, 1, 2, 3, 4]


async def test_cells_of_a_trend_are_as_wide_as_the_grid_and_share_no_reading(seen):
    by_eccentricity = await seen.json(TRENDS, **WHOLE, quantity=K, group_by="eccentricity")
    by_oil = await seen.json(TRENDS, **WHOLE, quantity=K, group_by="oil_temperature")

    assert [(g["low"], g["high"], minutes(g)) for g in by_eccentricity["groups"]] == [
        (0.3, 0.35, [0]),
        (0.35, 0.4, [1, 2]),
        (0.4, 0.45, [3]),
    ]
    assert [(g["low"], minutes(g)) for g in by_oil["groups"]] == [
        (30.0, [4]),
        (42.5, [0]),
        (45.0, [1, 2]),
        (47.5, [3]),
    ]
    asked = {"quantity": K, "group_by": "eccentricity", "eccentricity_min": 0.355}
    in_range = (await seen.json(TRENDS, **WHOLE, **asked))["groups"]
    assert [(g["name"], minutes(g)) for g in in_range] == [
        ("0.35 to 0.4", [2]),
        ("0.4 to 0.45", [3]),
    ]
    warm = {"quantity": K, "eccentricity_max": 0.4, "oil_temperature_min": 46.0}
    assert minutes(await seen.json(TRENDS, **WHOLE, **warm)) == [2]


async def test_more_groups_than_anybody_looks_at_are_refused(service, assessment):
    start_ns = START_NS + 3_600_000_000_000
    wild = [assessment(start_ns + n, eccentricity_ratio=1.0 + 0.05 * n) for n in range(61)]
    service.store.append(wild, [])

    found = await service.problem(TRENDS, 422, **WHOLE, quantity=K, group_by="eccentricity")

    assert "60 groups" in found["detail"]


async def groups_by(service: Any, ways: Sequence[str]) -> list[Any]:
    asked = {**WHOLE, "quantity": K, "max_points": 2}
    answers = [await service.json(TRENDS, **asked, group_by=by) for by in ways]
    return [group for answer in answers for group in answer["groups"]]


async def test_groups_are_the_same_when_they_have_been_gathered_beforehand(service, assessment):
    rollups = store_seen(service, assessment).store.rollups
    ways = ("state", "eccentricity", "oil_temperature")
    single = await groups_by(service, ways)
    later_ns = START_NS + 86_400_000_000_000

    for series in rollups.due(later_ns):
        rollups.gather(series, later_ns)

    assert rollups.due(later_ns) == []
    gathered = await groups_by(service, ways)
    assert [group["name"] for group in gathered] == [group["name"] for group in single]
    for ours, theirs in zip(gathered, single, strict=True):
        assert ours["time"] == theirs["time"]
        for column in ("minimum", "maximum", "count", "worst_level"):
            assert ours["series"][K][column] == theirs["series"][K][column]
        assert minutes(ours) == minutes(theirs)
