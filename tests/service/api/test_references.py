"""The API says which reference is in force, who set it, and what was before."""

from typing import Any

from service.store.references import GapReference, ReferenceSource

UJB = "/api/v1/units/U1/bearings/UJB"
T0 = 1_767_225_600_000_000_000


def reference(n: int, **changes: Any) -> GapReference:
    arguments = {"opposite_reference_um": None, "source": ReferenceSource.GIVEN} | changes
    return GapReference("U1", "UJB", T0 + n * 10**9, "A. Name", (1990.0 + n, 2003.1), **arguments)


async def test_a_reference_and_its_history_have_time_author_and_note(
    running: Any,
) -> None:
    running.store.add_reference(reference(1))
    known = {"source": ReferenceSource.MEASURED, "opposite_reference_um": (1.0, 2.0)}
    running.store.add_reference(reference(2, note="after the overhaul", **known))
    assert (await running.json(UJB))["reference"]["source"] == "plant_file"  # not yet taken over
    await running.references.look()

    body = await running.json(UJB)

    assert body["gap_reference_um"] == [1992.0, 2003.1]
    assert body["reference"] == {
        "source": "measured",
        "set": "2026-01-01T00:00:02.000Z",
        "author": "A. Name",
        "note": "after the overhaul",
    }
    assert body in await running.json("/api/v1/units/U1/bearings")
    other = await running.json("/api/v1/units/U1/bearings/LJB")
    assert other["reference"]["source"] == "plant_file"

    newest, oldest = await running.json(f"{UJB}/references")
    assert oldest == {
        "gap_reference_um": [1991.0, 2003.1],
        "opposite_reference_um": None,
        "source": "given",
        "set": "2026-01-01T00:00:01.000Z",
        "author": "A. Name",
        "note": None,
    }
    assert newest["set"] == "2026-01-01T00:00:02.000Z"
    assert newest["opposite_reference_um"] == [1.0, 2.0]
    assert await running.json("/api/v1/units/U2/bearings/UJB/references") == []


async def test_a_history_that_is_not_there_or_cannot_be_read_is_a_problem(
    running: Any, tmp_path: Any
) -> None:
    for path in ("U9/bearings/UJB", "U1/bearings/XJB"):
        problem = await running.problem(f"/api/v1/units/{path}/references", 404)
        assert path.partition("/")[0] in problem["detail"]
    (tmp_path / "padwatch.sqlite3").rename(tmp_path / "away")

    problem = await running.problem(f"{UJB}/references", 503)

    assert problem["title"] == "Store not available"
