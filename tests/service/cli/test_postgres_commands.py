"""Commands on a plant whose results are in PostgreSQL."""

from pathlib import Path

import pytest
from harness.places import PostgresPlace
from rigs.command_line import padwatch


@pytest.fixture
def plant_path(plant_path: Path, postgres_place: PostgresPlace) -> Path:
    """A plant file that names the database; its data folder is empty."""
    text, address = plant_path.read_text(), postgres_place.address.conninfo
    plant_path.write_text(f'{text}\n[store]\npostgresql = "{address}"\n')
    return plant_path


def run(*arguments: object, exit_code: int = 0) -> str:
    """Run a command; what it says."""
    done = padwatch(*arguments)
    assert done.exit_code == exit_code, done.output
    return done.output


def test_commands_work_on_the_server_and_make_no_file(plant_path: Path, tmp_path: Path) -> None:
    run("keys", "create", plant_path, "wall", "--role", "viewer")
    gaps = ("--x-um", "2000", "--y-um", "2001")
    place = ("--unit", "U1", "--bearing", "UJB")
    run("reference", "set", plant_path, *place, *gaps, "--author", "Ada")
    assert "wall" in run("keys", "list", plant_path)
    assert "2 entries" in run("audit", "verify", plant_path)
    assert "2001" in run("reference", "list", plant_path)
    assert not list(tmp_path.rglob("*.sqlite3"))


def test_copies_are_left_to_the_servers_own_tools(plant_path: Path, tmp_path: Path) -> None:
    for arguments in (("backup", plant_path, tmp_path), ("restore", plant_path, tmp_path / "copy")):
        said = run(*arguments, exit_code=1)
        assert "must be copied with pg_dump or pg_basebackup" in said
        assert len(said.strip().splitlines()) == 1
