"""What is there as a table says the same as the JSON answer."""

import csv
import io
from typing import Any

import pyarrow.parquet as pq

HOUR_NS = 3_600_000_000_000
RANGE = {"start": "2026-01-01T00:00:00Z", "end": "2026-02-01T00:00:00Z"}


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


async def test_the_history_of_alarms_is_the_same_as_csv(service: Any) -> None:
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


async def test_the_audit_trail_is_the_same_as_csv(service: Any) -> None:
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


async def test_the_line_of_the_shaft_centre_is_the_same_in_parquet(read_only: Any) -> None:
    path = "/api/v1/units/U1/bearings/UJB/shaft-centre"
    line = await read_only.json(path, **RANGE)
    assert line["time"]

    response = await read_only.get(path, **RANGE, format="parquet")

    table = pq.read_table(io.BytesIO(response.content))
    times_ns = table["time_utc"].cast("int64").to_pylist()
    assert [time_ns / 1_000_000_000 for time_ns in times_ns] == line["time"]
    assert table["shaft_centre_x_um_mean"].to_pylist() == line["x_um"]["mean"]
    assert table["eccentricity_ratio_mean"].to_pylist() == line["eccentricity_ratio"]["mean"]
    assert table.schema.field("shaft_centre_x_um_mean").metadata == {b"unit": "µm".encode()}
