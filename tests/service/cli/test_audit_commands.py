"""`padwatch audit` on the file of a plant."""

import csv
import json
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from rigs.command_line import padwatch
from typer.testing import Result

from service.store.access.audit_entries import AuditAction
from service.store.access.audit_verification import head_path
from service.store.sqlite import SqliteStore

T0 = 1_767_225_600_000_000_000
HOSTILE = ["=1+1", "+1", "-1", "@A1", "\t=1", " =1", "\r=1", "＝1+1", "|cmd", "'=1", "a\nb", "\x00"]


def audit(*arguments: object) -> Result:
    return padwatch("audit", *arguments)


@pytest.fixture
def database(plant_path: Path) -> Path:
    """A plant's database with an entry for each hostile name."""
    path = plant_path.with_name("data") / "padwatch.sqlite3"
    store = SqliteStore(path)
    store.audit.record(
        [AuditAction(T0, name, "x", name, reason=name, after=name) for name in HOSTILE]
    )
    store.close()
    return path


def test_a_whole_trail_is_whole(plant_path: Path, database: Path) -> None:
    said, document = audit("verify", plant_path), audit("verify", plant_path, "--json")
    found = json.loads(document.stdout)
    assert (said.exit_code, document.exit_code) == (0, 0)
    assert said.stdout.startswith(f"{len(HOSTILE)} entries are intact; the hash of the last is ")
    assert (found["is_whole"], found["n_entries"], found["finding"]) == (True, len(HOSTILE), None)
    assert found["hash"] == json.loads(head_path(database).read_text())["hash"]


def test_an_altered_entry_is_named(plant_path: Path, database: Path) -> None:
    with closing(sqlite3.connect(database)) as other:
        other.executescript(
            "DROP TRIGGER audit_kept_as_told; UPDATE audit SET actor = 'x' WHERE number = 4"
        )
    said, document = audit("verify", plant_path), audit("verify", plant_path, "--json")
    assert (said.exit_code, document.exit_code) == (1, 1)
    assert said.stdout.endswith("CORRUPT: entry 4 was altered\n")
    assert json.loads(document.stdout)["finding"]["number"] == 4


def test_a_restored_backup_can_be_said_to_be_known(plant_path: Path, database: Path) -> None:
    head_path(database).unlink()
    store = SqliteStore(database)
    store.audit.record([AuditAction(T0, "A", "x", "y")])
    store.close()
    number = len(HOSTILE) + 1
    unknown, known = audit("verify", plant_path), audit("verify", plant_path, f"--known={number}")
    assert (unknown.exit_code, known.exit_code) == (1, 0)
    assert f"entry {number} reports that the head did not match" in unknown.stdout


def test_an_export_holds_nothing_that_a_spreadsheet_computes(
    plant_path: Path, database: Path
) -> None:
    out = plant_path.with_name("audit.csv")
    said = audit("export", plant_path, out)
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


def test_an_export_never_overwrites(plant_path: Path, database: Path) -> None:
    out = plant_path.with_name("audit.csv")
    out.write_text("mine")
    assert audit("export", plant_path, out).exit_code == 1
    assert audit("export", plant_path, out.with_suffix(".xls")).exit_code == 2
    assert out.read_text() == "mine"
    assert database.exists()
