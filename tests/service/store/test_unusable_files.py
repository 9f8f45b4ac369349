"""What is wrong with where the database is to be ends `padwatch run` with one sentence."""

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.cli.commands import app
from service.store.sqlite import SqliteStore

NOBODY = 65534
DATABASE = "padwatch.sqlite3"


def database_in(data: Path) -> Path:
    """Make a database in a data folder."""
    SqliteStore(data / DATABASE).close()
    return data / DATABASE


def log_of_somebody_else(data: Path) -> None:
    log = data / f"{database_in(data).name}-wal"
    log.touch()
    log.chmod(0o400)


def file_in_place_of_the_folder(data: Path) -> None:
    data.rmdir()
    data.touch()


def folder_that_cannot_be_made(data: Path) -> None:
    data.rmdir()
    data.parent.chmod(0o555)


GIVE_FILE = "may not read and write {data}/padwatch.sqlite3: change its owner to that user"
GIVE_FOLDER = "may not read or create the folder {data}: change its owner to that user"
CASES: dict[str, tuple[Callable[[Path], object], str]] = {
    "read-only file": (lambda data: database_in(data).chmod(0o444), GIVE_FILE),
    "unreadable file": (lambda data: database_in(data).chmod(0), GIVE_FILE),
    "read-only folder": (
        lambda data: database_in(data).parent.chmod(0o555),
        "may not create files in {data}: change its owner to that user",
    ),
    "log of somebody else": (
        log_of_somebody_else,
        "may not read and write {data}/padwatch.sqlite3-wal: change its owner to",
    ),
    "folder without permission": (lambda data: data.chmod(0), GIVE_FOLDER),
    "directory in its place": (
        lambda data: (data / DATABASE).mkdir(),
        "{data}/padwatch.sqlite3 is a folder: move it away",
    ),
    "file in place of the folder": (
        file_in_place_of_the_folder,
        "{data} cannot be created because a file is in its place: move it",
    ),
    "folder that cannot be made": (folder_that_cannot_be_made, GIVE_FOLDER),
}


@pytest.fixture
def place() -> Iterator[Path]:
    """A folder that everybody can reach."""
    folder = Path(tempfile.mkdtemp(prefix="padwatch-"))
    yield folder
    for inner, _, _ in os.walk(folder):
        Path(inner).chmod(0o700)
    shutil.rmtree(folder)


def prepared(folder: Path, plant_text: str, prepare: Callable[[Path], object]) -> Path:
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


@contextmanager
def as_nobody() -> Iterator[None]:
    """Be a user without privileges for a while: root may do everything."""
    is_root = os.geteuid() == 0
    if is_root:
        os.setresgid(NOBODY, NOBODY, 0)
        os.setresuid(NOBODY, NOBODY, 0)
    try:
        yield
    finally:
        if is_root:
            os.setresuid(0, 0, 0)
            os.setresgid(0, 0, 0)


@pytest.mark.parametrize("name", CASES)
def test_each_is_told_in_one_sentence_with_what_to_do(
    place: Path, plant_text: str, name: str
) -> None:
    prepare, said = CASES[name]
    place.chmod(0o755)
    plant = prepared(place / "plant", plant_text, prepare)
    with as_nobody():
        result = CliRunner().invoke(app, ["run", str(plant), "--port", "0"])

    assert result.exit_code == 1, result.output
    assert said.format(data=plant.parent / "data") in result.stderr
    assert result.stderr.count("\n") == 1, result.stderr


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
