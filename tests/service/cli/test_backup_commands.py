"""`padwatch backup` and `padwatch restore`, as they are typed."""

import json
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from service.cli.commands import app
from service.store.sqlite import SqliteStore

ROOT = Path(__file__).parents[3]


def typed(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def test_a_plants_database_is_copied_and_put_back(tmp_path: Path) -> None:
    plant = tmp_path / "plant.toml"
    text = (ROOT / "deploy" / "plant.toml").read_text(encoding="utf-8")
    data = tmp_path / "data"
    plant.write_text(
        text.replace('data_folder = "var"', f'data_folder = "{data}"'), encoding="utf-8"
    )
    SqliteStore(data / "padwatch.sqlite3").close()

    made = json.loads(typed("backup", plant, tmp_path / "copies", "--json").output)
    said = typed("backup", plant, tmp_path / "more", "--keep", "1")
    done = typed("restore", plant, made["backup"], "--json")

    assert made["n_bytes"] > 0
    assert made["n_rows"]["gap"] == 0
    assert said.exit_code == 0
    assert "verified" in said.output
    assert done.exit_code == 0
    assert json.loads(done.output)["database"] == str(data / "padwatch.sqlite3")


def test_what_cannot_be_copied_ends_with_one_line() -> None:
    found = typed("backup", ROOT / "deploy" / "demo.toml", "/proc/nowhere")

    assert found.exit_code == 1
    assert found.output.startswith("padwatch backup: ")
    assert len(found.output.splitlines()) == 1
