"""`padwatch reference set|list`."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch, padwatch_program

OPTIONS = {"unit": "U1", "bearing": "UJB", "author": "A. Name", "x-um": 1998.5, "y-um": 2003.1}


def set_reference(run: Callable[..., Any], plant: Path, *flags: str, **changes: Any) -> Any:
    named = {name.replace("_", "-"): value for name, value in changes.items()}
    options = [f"--{name}={v}" for name, v in (OPTIONS | named).items() if v is not None]
    return run("reference", "set", plant, *options, *flags)


def test_what_was_set_is_listed_with_time_author_and_what_was_before(plant_path: Path) -> None:
    first = set_reference(padwatch_program, plant_path)
    second = set_reference(
        padwatch, plant_path, "--json", x_um=1990.25, author=" B. Name ", note="after the overhaul"
    )
    text = padwatch("reference", "list", plant_path)
    listed = {
        (r["unit"], r["bearing"]): r
        for r in json.loads(padwatch("reference", "list", plant_path, "--json").stdout)
    }

    assert [result.exit_code for result in (first, second, text)] == [0, 0, 0]
    assert first.stdout.startswith("U1 UJB: 1998.5, 2003.1 µm, given, set 20")
    assert first.stdout.endswith("Z by A. Name\n")
    assert first.stderr.endswith("created a new database; check that the service uses it\n")
    assert second.stderr == ""
    assert json.loads(second.stdout) == listed["U1", "UJB"]
    upper = listed["U1", "UJB"]
    assert upper["gap_reference_um"] == [1990.25, 2003.1]
    assert upper["reference"] == {
        "source": "given",
        "set": upper["history"][0]["set"],
        "author": "B. Name",
        "note": "after the overhaul",
    }
    assert [before["author"] for before in upper["history"]] == ["B. Name", "A. Name"]
    assert listed["U1", "LJB"]["reference"]["source"] == "plant_file"
    assert listed["U1", "LJB"]["history"] == []
    lines = text.stdout.splitlines()
    assert lines[0].endswith("by B. Name: after the overhaul")
    assert lines[1].startswith("  before: 1998.5, 2003.1 µm, given, set 20")
    assert lines[2] == "U1 LJB: 2000, 2000 µm, from the plant file"
    assert len(lines) == 7


@pytest.mark.parametrize(
    ("flags", "changes", "said"),
    [
        ((), {"x_um": "nan"}, "gap x is nan µm, must be above 0 and at most 10000 µm"),
        ((), {"opposite_x_um": 2000}, "bearing UJB has no opposite probe in x"),
        ((), {"bearing": "XJB"}, "unit U1: unknown bearing XJB; known bearings: UJB, LJB, TJB"),
        ((), {"unit": "U9"}, "unknown unit U9; known units: U1, U2"),
        (
            ("--measured",),
            {"x_um": None, "y_um": None},
            "no result is stored yet",
        ),
        (("--measured",), {}, "padwatch reference set: give gaps or --measured, not both"),
    ],
    ids=lambda value: None if isinstance(value, str) else "-".join(value),
)
def test_a_wrong_reference_is_one_line_with_value_and_limit_and_leaves_nothing_behind(
    plant_path: Path, flags: tuple[str, ...], changes: dict[str, Any], said: str
) -> None:
    result = set_reference(padwatch, plant_path, *flags, **changes)

    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert not (plant_path.parent / "data").exists()


def test_looking_at_references_creates_no_database(plant_path: Path) -> None:
    result = padwatch("reference", "list", plant_path)

    assert result.exit_code == 0
    assert result.stderr == ""
    assert not (plant_path.parent / "data").exists()


@pytest.mark.parametrize("command", ["set", "list"])
def test_a_database_that_cannot_be_used_is_one_line_and_exit_1(
    plant_path: Path, command: str
) -> None:
    folder = plant_path.parent / "data"
    folder.mkdir()
    (folder / "padwatch.sqlite3").write_bytes(b"speed;power\n92.3;700\n" * 100)

    result = (
        set_reference(padwatch, plant_path)
        if command == "set"
        else padwatch("reference", "list", plant_path)
    )

    assert result.exit_code == 1
    assert "file is not a database" in result.stderr
    assert result.stderr.count("\n") == 1
