"""Notes on the time axis: added over HTTP, kept in the audit trail, and never changed."""

from service.api.routes.alarms import N_COMMENTS

NOTES = "/api/v1/units/U1/notes"
AT = "2026-01-01T08:00:00.000Z"
SHIMS = {"actor": "A. Name", "time": AT, "bearing": "UJB", "text": "shims changed"}


async def test_a_note_is_listed_at_its_time_with_who_wrote_it(service):
    added = await service.client.post(NOTES, json=SHIMS)
    of_unit = await service.client.post(
        NOTES, json=SHIMS | {"time": "2026-01-01T06:00:00-03:00", "bearing": None}
    )

    assert added.status_code == of_unit.status_code == 200
    first = {"bearing": "UJB", "time": AT, "text": "shims changed"}
    assert added.json() == first | {"author": "A. Name"}
    second = of_unit.json()
    assert (second["time"], second["bearing"]) == ("2026-01-01T09:00:00.000Z", None)
    assert await service.json(NOTES) == [second, added.json()]
    until = await service.json(NOTES, start=AT, end="2026-01-01T09:00:00Z")
    assert until == [added.json()]
    assert await service.json("/api/v1/units/U2/notes") == []


async def test_the_audit_trail_tells_who_added_a_note_from_where_and_when(service):
    await service.client.post(NOTES, json=SHIMS)

    [entry] = (await service.json("/api/v1/audit", action="note.added"))["entries"]

    assert (entry["actor"], entry["object"], entry["peer"]) == ("A. Name", "U1", "127.0.0.1")
    assert entry["time"] == "2026-01-01T00:00:00.000Z"  # by the clock of the host
    assert entry["after"]["text"] == "shims changed"


async def test_a_note_that_cannot_be_placed_is_refused(service):
    for path, status, changes in (
        (NOTES, 404, {"bearing": "XYZ"}),
        ("/api/v1/units/U9/notes", 404, {}),
        (NOTES, 422, {"text": " "}),
        (NOTES, 422, {"text": "two\nlines"}),
        (NOTES, 422, {"time": 1767225600}),
        (NOTES, 422, {"time": "2026-01-01T08:00:00"}),
        (NOTES, 422, {"actor": ""}),
    ):
        await service.refused(path, status, SHIMS | changes)
    await service.problem("/api/v1/units/U9/notes", 404)
    assert await service.json(NOTES) == []


async def test_notes_without_end_have_to_wait(service):
    statuses = [
        (await service.client.post(NOTES, json=SHIMS)).status_code for _ in range(N_COMMENTS + 1)
    ]

    assert statuses == [200] * N_COMMENTS + [429]
    assert len(await service.json(NOTES)) == N_COMMENTS
