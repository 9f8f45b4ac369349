"""`padwatch audit` on the file of a plant."""

import csv
import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from service.audit.entry import Deed
from service.audit.head import head_path
from service.cli.commands import app
from service.store.sqlite import SqliteStore

T0 = 1_767_225_600_000_000_000
HOSTILE = ["=1+1", "+1", "-1", "@A1", "\t=1", " =1", "\r=1", "＝1+1", "|cmd", "'=1", "a\nb", "\x00"]


def padwatch(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["audit", *map(str, arguments)])


@pytest.fixture
def plant(plant_text: str, tmp_path: Path) -> Path:
    path, old = tmp_path / "plant.toml", 'data_folder = "var/demo"'
    assert old in plant_text
    path.write_text(plant_text.replace(old, f'data_folder = "{tmp_path}"'), encoding="utf-8")
    return path


@pytest.fixture
def database(plant: Path) -> Path:
    """A plant's database with an entry for each hostile name."""
    path = plant.with_name("padwatch.sqlite3")
    store = SqliteStore(path)
    store.audit.record([Deed(T0, name, "x", name, reason=name, after=name) for name in HOSTILE])
    store.close()
    return path


def test_a_whole_trail_is_whole(plant: Path, database: Path) -> None:
    said, document = padwatch("verify", plant), padwatch("verify", plant, "--json")
    found = json.loads(document.stdout)
    assert (said.exit_code, document.exit_code) == (0, 0)
    assert said.stdout.startswith(f"{len(HOSTILE)} entries are whole; the last has the hash ")
    assert (found["is_whole"], found["n_entries"], found["finding"]) == (True, len(HOSTILE), None)
    assert found["hash"] == json.loads(head_path(database).read_text())["hash"]


def test_an_altered_entry_is_named(plant: Path, database: Path) -> None:
    with closing(sqlite3.connect(database)) as other:
        other.executescript(
            "DROP TRIGGER audit_kept_as_told; UPDATE audit SET actor = 'x' WHERE number = 4"
        )
    said, document = padwatch("verify", plant), padwatch("verify", plant, "--json")
    assert (said.exit_code, document.exit_code) == (1, 1)
    assert said.stdout.endswith("NOT WHOLE: entry 4 was altered\n")
    assert json.loads(document.stdout)["finding"]["number"] == 4


def test_a_restored_backup_can_be_said_to_be_known(plant: Path, database: Path) -> None:
    head_path(database).unlink()
    store = SqliteStore(database)
    store.audit.record([Deed(T0, "A", "x", "y")])
    store.close()
    number = len(HOSTILE) + 1
    unknown, known = padwatch("verify", plant), padwatch("verify", plant, f"--known={number}")
    assert (unknown.exit_code, known.exit_code) == (1, 0)
    assert f"entry {number} tells that the head did not fit" in unknown.stdout


def test_an_export_holds_nothing_that_a_spreadsheet_computes(plant: Path, database: Path) -> None:
    out = plant.with_name("audit.csv")
    said = padwatch("export", plant, out)
    with out.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)

    assert (said.exit_code, said.stdout) == (0, f"{out}: {len(HOSTILE)} entries\n")
    assert header[:4] == ["time", "number", "time_ns", "actor"]
    assert [row[3].removeprefix("'") for row in rows] == [
        name.removeprefix("'" if name != "'=1" else "").replace("\0", "\ufffd") for name in HOSTILE
    ]
    for row in rows:
        for cell in row:
            assert not cell.strip().startswith(("=", "+", "-", "@", "|", "＝")), row
    assert database.exists()


def test_an_export_never_overwrites(plant: Path, database: Path) -> None:
    out = plant.with_name("audit.csv")
    out.write_text("mine")
    assert padwatch("export", plant, out).exit_code == 1
    assert padwatch("export", plant, out.with_suffix(".xls")).exit_code == 2
    assert out.read_text() == "mine"
    assert database.exists()


def test_where_there_is_no_database_that_is_said(plant: Path) -> None:
    for arguments in (("verify", plant), ("export", plant, plant.with_name("a.csv"))):
        said = padwatch(*arguments)
        assert said.exit_code == 1
        assert "there is no database" in said.stderr
    assert sorted(path.name for path in plant.parent.iterdir()) == ["plant.toml"]
