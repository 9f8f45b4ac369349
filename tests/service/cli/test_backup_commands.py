"""`padwatch backup` and `padwatch restore`, as they are typed."""

import json
from pathlib import Path

from rigs.command_line import padwatch

from service.store.sqlite import SqliteStore


def test_a_plants_database_is_copied_and_put_back(plant_path: Path, tmp_path: Path) -> None:
    data = tmp_path / "data"
    SqliteStore(data / "padwatch.sqlite3").close()

    made = json.loads(padwatch("backup", plant_path, tmp_path / "copies", "--json").output)
    said = padwatch("backup", plant_path, tmp_path / "more", "--keep", "1")
    done = padwatch("restore", plant_path, made["backup"], "--json")

    assert made["n_bytes"] > 0
    assert made["n_rows"]["gap"] == 0
    assert said.exit_code == 0
    assert "verified" in said.output
    assert done.exit_code == 0
    assert json.loads(done.output)["database"] == str(data / "padwatch.sqlite3")


def test_what_cannot_be_copied_ends_with_one_line(deploy: Path) -> None:
    found = padwatch("backup", deploy / "demo.toml", "/proc/nowhere")

    assert found.exit_code == 1
    assert found.output.startswith("padwatch backup: ")
    assert len(found.output.splitlines()) == 1
