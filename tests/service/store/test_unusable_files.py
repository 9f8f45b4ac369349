"""What is wrong with where the database is to be ends `padwatch run` with one sentence."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from service.store.sqlite import SqliteStore

NOBODY = 65534
DATABASE = "padwatch.sqlite3"
RUN = """
import json, os, sys
from typer.testing import CliRunner
from service.cli.commands import app
if os.geteuid() == 0:  # who may do everything
    os.setgid(65534), os.setuid(65534)
told = {}
for plant in sys.argv[1:]:
    result = CliRunner().invoke(app, ["run", plant, "--port", "0"])
    told[plant] = [result.exit_code, result.stderr]
print(json.dumps(told))
"""


def read_only_file(data: Path) -> None:
    SqliteStore(data / DATABASE).close()
    (data / DATABASE).chmod(0o444)


def unreadable_file(data: Path) -> None:
    SqliteStore(data / DATABASE).close()
    (data / DATABASE).chmod(0)


def read_only_folder(data: Path) -> None:
    SqliteStore(data / DATABASE).close()
    data.chmod(0o555)


def log_of_somebody_else(data: Path) -> None:
    SqliteStore(data / DATABASE).close()
    (data / f"{DATABASE}-wal").touch()
    (data / f"{DATABASE}-wal").chmod(0o400)


def folder_without_permission(data: Path) -> None:
    data.chmod(0)


def directory_in_its_place(data: Path) -> None:
    (data / DATABASE).mkdir()


def file_in_place_of_the_folder(data: Path) -> None:
    data.rmdir()
    data.touch()


def folder_that_cannot_be_made(data: Path) -> None:
    data.rmdir()
    data.parent.chmod(0o555)


CASES: dict[Callable[[Path], None], str] = {
    read_only_file: "may not read and write {data}/padwatch.sqlite3: give it to that user",
    unreadable_file: "may not read and write {data}/padwatch.sqlite3: give it to that user",
    read_only_folder: "may not make files in {data}: give it to that user",
    log_of_somebody_else: "may not read and write {data}/padwatch.sqlite3-wal: give it to",
    folder_without_permission: "may not look into or make the folder {data}: give it to that user",
    directory_in_its_place: "{data}/padwatch.sqlite3 is a folder: move it away",
    file_in_place_of_the_folder: "{data} cannot be a folder, for a file is in its place: move it",
    folder_that_cannot_be_made: "may not look into or make the folder {data}: give it to that user",
}


@pytest.fixture
def place() -> Iterator[Path]:
    """A folder that everybody can reach."""
    folder = Path(tempfile.mkdtemp(prefix="padwatch-"))
    yield folder
    for inner, _, _ in os.walk(folder):
        Path(inner).chmod(0o700)
    shutil.rmtree(folder)


def prepared(folder: Path, plant_text: str, prepare: Callable[[Path], None]) -> Path:
    """A plant file whose data folder has something wrong with it, all of it nobody's."""
    data = folder / "data"
    data.mkdir(parents=True)
    path = folder / "plant.toml"
    reached = plant_text.replace("port = 0", "port = 9")  # where nobody answers
    path.write_text(reached.replace('"var/demo"', f'"{data}"'))
    prepare(data)
    if os.geteuid() == 0:
        for one in (folder, *folder.rglob("*")):
            os.chown(one, NOBODY, NOBODY)
    return path


def test_each_is_told_in_one_sentence_with_what_to_do(place: Path, plant_text: str) -> None:
    place.chmod(0o755)
    plants = {
        str(prepared(place / prepare.__name__, plant_text, prepare)): words
        for prepare, words in CASES.items()
    }
    child = subprocess.run(
        [sys.executable, "-c", RUN, *plants],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert child.returncode == 0, child.stderr
    told = json.loads(child.stdout.splitlines()[-1])

    for plant, words in plants.items():
        exit_code, message = told[plant]
        assert exit_code == 1, (plant, message)
        assert words.format(data=Path(plant).parent / "data") in message, (plant, message)
        assert message.count("\n") == 1, message


def test_a_folder_that_is_not_there_is_made(path: Path) -> None:
    with closing(SqliteStore(path.parent / "deeper" / "down" / path.name)) as store:
        assert not store.integrity.found


def test_an_empty_file_is_a_new_database_and_one_that_became_empty_is_told(path: Path) -> None:
    path.parent.mkdir()
    path.touch()
    with closing(SqliteStore(path)) as store:
        assert not store.integrity.found
    path.write_bytes(b"")
    with closing(SqliteStore(path)) as store:
        assert [finding.kind for finding in store.integrity.found] == ["replaced"]
