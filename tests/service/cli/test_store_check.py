"""`padwatch store check` reads everything and says what is wrong."""

import json
import sqlite3
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch

from core.monitor.assessment import Assessment
from service.store.highwater.commits import MAX_BEHIND
from service.store.sqlite import SqliteStore, checking

Build = Callable[..., Assessment]
T0 = 1_767_225_600_000_000_000


@pytest.fixture
def plant(plant_path: Path, tmp_path: Path, assessment: Build) -> Path:
    """A plant file, with some results in its data folder."""
    with closing(SqliteStore(tmp_path / "data" / "padwatch.sqlite3")) as store:
        store.append([assessment(T0 + n, speed_rpm=float(n)) for n in range(5)], [])
    return plant_path


def damage(plant: Path, statement: str) -> None:
    with closing(sqlite3.connect(plant.parent / "data" / "padwatch.sqlite3")) as other, other:
        other.execute(statement)


def test_a_database_that_is_whole_is_said_to_be(plant: Path) -> None:
    result = padwatch("store", "check", plant)

    assert result.exit_code == 0, result.output
    assert result.stdout.endswith("padwatch.sqlite3: whole\n")


def test_altered_and_missing_rows_are_named(plant: Path) -> None:
    damage(plant, f"UPDATE assessment SET coverage = 0.5 WHERE time_ns = {T0 + 1}")  # noqa: S608
    damage(plant, f"DELETE FROM assessment WHERE time_ns = {T0 + 3}")  # noqa: S608

    result = padwatch("store", "check", plant, "--json")

    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert not found["is_whole"]
    assert found["findings"] == [
        {"kind": "missing", "detail": f"assessment: series 1, time_ns {T0 + 3}"},
        {"kind": "altered", "detail": f"assessment: series 1, time_ns {T0 + 1}"},
    ]


def test_a_database_that_was_rolled_back_is_told(plant: Path) -> None:
    damage(plant, "UPDATE high_water SET n_commits = 1")

    result = padwatch("store", "check", plant)

    assert result.exit_code == 1
    assert "high_water: the database was rolled back" in result.stdout
    assert "CORRUPT: 1 high_water" in result.stdout


def test_a_service_that_writes_meanwhile_is_no_fault(
    plant: Path, assessment: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    look_at_rows = checking._look_at_rows
    with closing(SqliteStore(plant.parent / "data" / "padwatch.sqlite3")) as store:

        def slowly(*args: Any) -> None:
            for n in range(MAX_BEHIND + 2):
                store.append([assessment(T0 + 100 + n)], [])
            look_at_rows(*args)

        monkeypatch.setattr(checking, "_look_at_rows", slowly)
        result = padwatch("store", "check", plant)

    assert result.exit_code == 0, result.output
