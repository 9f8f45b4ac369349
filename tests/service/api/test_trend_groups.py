"""Trends parted by operating state and by cells of eccentricity and oil temperature."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.monitor.assessment import Assessment
from service.settings.plant import PlantFile

TRENDS = "/api/v1/units/U1/bearings/UJB/trends"
START_NS = 1_767_225_600_000_000_000
WHOLE = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}
K = "stiffness_xx_n_per_m"

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
def seen(
    serve: Any, plant: PlantFile, database_file: Path, assessment: Callable[..., Assessment]
) -> Any:
    """A service with these results, for tests that only read."""
    return store_seen(serve(plant, database_file), assessment)


def minutes(series: Any) -> list[int]:
    return [round(mean - 1e9) for mean in series["series"][K]["mean"] if mean is not None]


async def test_a_trend_is_of_some_states_or_has_a_series_for_each_that_there_was(seen: Any) -> None:
    some = await seen.json(TRENDS, **WHOLE, quantity=K, state=["part_load", "standstill"])
    assert (minutes(some), some["groups"]) == ([0, 1, 4], None)

    found = await seen.json(TRENDS, **WHOLE, quantity=K, group_by="state")

    assert {group["name"]: minutes(group) for group in found["groups"]} == {
        "standstill": [4],
        "part_load": [0, 1],
        "full_load": [2, 3],
    }
    assert minutes(found) == [0, 1, 2, 3, 4]


async def test_cells_of_a_trend_are_as_wide_as_the_grid_and_share_no_reading(seen: Any) -> None:
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


async def test_more_groups_than_anybody_looks_at_are_refused(
    service: Any, assessment: Callable[..., Assessment]
) -> None:
    start_ns = START_NS + 3_600_000_000_000
    wild = [assessment(start_ns + n, eccentricity_ratio=1.0 + 0.05 * n) for n in range(61)]
    service.store.append(wild, [])

    found = await service.problem(TRENDS, 422, **WHOLE, quantity=K, group_by="eccentricity")

    assert "60 groups" in found["detail"]


async def groups_by(service: Any, ways: Sequence[str]) -> list[Any]:
    asked = {**WHOLE, "quantity": K, "max_points": 2}
    answers = [await service.json(TRENDS, **asked, group_by=by) for by in ways]
    return [group for answer in answers for group in answer["groups"]]


async def test_groups_are_the_same_when_they_have_been_gathered_beforehand(
    service: Any, assessment: Callable[..., Assessment]
) -> None:
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
        for column in ("min", "max", "count", "worst_level"):
            assert ours["series"][K][column] == theirs["series"][K][column]
        assert minutes(ours) == minutes(theirs)
