"""`padwatch store check`, `recording check`, `backup` and `restore`: what is whole, and copies."""

import json
import shutil
import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigs.blocks import cell_block
from rigs.command_line import padwatch

from acquisition.clock import SystemClock
from acquisition.recordings.manifest import RecordedUnit
from acquisition.recordings.writer import RecordingWriter
from core.monitor.assessment import Assessment
from service.api.auth.authenticator import Authenticator
from service.app.kept_files import waveform_keeper
from service.app.storage import open_store
from service.settings.adapter_values import recorded_unit
from service.settings.plant import load_plant_file
from service.store.access.identities import KeyState, Role, Session
from service.store.highwater.commits import MAX_BEHIND
from service.store.sqlite import SqliteStore, checking
from service.store.sqlite.store import open_access_file
from service.store.waveforms import WaveformKind

Build = Callable[..., Assessment]
T0 = 1_767_225_600_000_000_000


@pytest.fixture
def plant(plant_path: Path, tmp_path: Path, assessment: Build) -> Path:
    """A plant file, with some results and an account in its data folder."""
    with closing(open_access_file(tmp_path / "data" / "access.sqlite3")) as access:
        access.accounts.add("anna", Role.ADMIN, "hash", T0)
    with closing(SqliteStore(tmp_path / "data" / "padwatch.sqlite3")) as store:
        store.append([assessment(T0 + n, speed_rpm=float(n)) for n in range(5)], [])
    return plant_path


def damage(plant: Path, statement: str) -> None:
    with closing(sqlite3.connect(plant.parent / "data" / "padwatch.sqlite3")) as other, other:
        other.execute(statement)


def test_a_database_that_is_whole_is_said_to_be(plant):
    result = padwatch("store", "check", plant)

    assert result.exit_code == 0, result.output
    first, second = result.stdout.splitlines()
    assert first.endswith("padwatch.sqlite3: whole")
    assert second.endswith("access.sqlite3: whole")


def test_an_account_that_was_altered_is_named(plant):
    with closing(sqlite3.connect(plant.parent / "data" / "access.sqlite3")) as other, other:
        other.execute("UPDATE account SET password_hash = 'mine'")

    result = padwatch("store", "check", plant, "--json")

    assert result.exit_code == 1
    files = json.loads(result.stdout)["files"]
    assert files["padwatch.sqlite3"]["is_whole"]
    assert files["access.sqlite3"]["findings"] == [
        {"kind": "altered", "detail": "account: name 'anna'"}
    ]


def test_altered_and_missing_rows_are_named(plant):
    damage(plant, f"UPDATE assessment SET coverage = 0.5 WHERE time_ns = {T0 + 1}")  # noqa: S608
    damage(plant, f"DELETE FROM assessment WHERE time_ns = {T0 + 3}")  # noqa: S608

    result = padwatch("store", "check", plant, "--json")

    assert result.exit_code == 1
    found = json.loads(result.stdout)
    assert not found["is_whole"]
    assert found["files"]["padwatch.sqlite3"]["findings"] == [
        {"kind": "missing", "detail": f"assessment: series 1, time_ns {T0 + 3}"},
        {"kind": "altered", "detail": f"assessment: series 1, time_ns {T0 + 1}"},
    ]


def test_a_database_that_was_rolled_back_is_told(plant):
    damage(plant, "UPDATE high_water SET n_commits = 1")

    result = padwatch("store", "check", plant)

    assert result.exit_code == 1
    assert "high_water: the database was rolled back" in result.stdout
    assert "CORRUPT: 1 high_water" in result.stdout


def test_a_service_that_writes_meanwhile_is_no_fault(plant, assessment, monkeypatch):
    look_at_rows = checking._look_at_rows
    with closing(SqliteStore(plant.parent / "data" / "padwatch.sqlite3")) as store:

        def slowly(*args: Any) -> None:
            for n in range(MAX_BEHIND + 2):
                store.append([assessment(T0 + 100 + n)], [])
            look_at_rows(*args)

        monkeypatch.setattr(checking, "_look_at_rows", slowly)
        result = padwatch("store", "check", plant)

    assert result.exit_code == 0, result.output


START_NS = 1_767_225_600_000_000_000


def make(folder: Path, unit: RecordedUnit) -> Path:
    counts = np.arange(600 * len(unit.channels), dtype=np.int16).reshape(len(unit.channels), -1)
    slow = (1.0,) * len(unit.slow_channels)
    with RecordingWriter(folder, unit, "a test") as writer:
        ok = (True,) * len(unit.channels)
        writer.write(
            cell_block(1, 0, START_NS, unit.rate_hz, counts, ok, slow, (), unit.calibration)
        )
    return folder


@pytest.fixture
def recorded_plant(plant_path: Path) -> Path:
    """A plant with three recordings in its index, as a running service has left them."""
    settings = load_plant_file(plant_path)
    root = plant_path.parent / "data" / "recordings"
    root.mkdir(parents=True)
    for number in range(3):
        make(root / f"U1-{number}", recorded_unit(settings.unit[0]))
    with closing(open_store(settings)) as store:
        keeper = waveform_keeper(settings, store, SystemClock())
        while keeper.n_files.get(WaveformKind.CONTINUOUS, 0) < 3:  # one look ends after 2 s
            keeper.look()
        keeper.close()
    return plant_path


def run(recorded_plant: Path, *options: str) -> Any:
    return padwatch("recording", "check", recorded_plant, *options)


def test_a_plant_whose_recordings_are_whole_is_said_to_be(recorded_plant):
    found = run(recorded_plant)

    assert found.exit_code == 0, found.output
    assert found.output.strip() == "3 sound, 0 not entered, 0 damaged, 0 missing, 0 unfinished"


def test_each_recording_with_something_wrong_is_named_with_it(recorded_plant):
    root = recorded_plant.parent / "data" / "recordings"
    shutil.rmtree(root / "U1-0")
    samples = root / "U1-1" / "samples.parquet"
    samples.write_bytes(samples.read_bytes()[:-1])
    make(root / "U1-3", recorded_unit(load_plant_file(recorded_plant).unit[0]))
    (root / "U1-4.incomplete").mkdir()
    before = sorted(path.name for path in root.iterdir())

    found = run(recorded_plant, "--json")
    assert found.exit_code == 1
    document = json.loads(found.output)
    assert [(each["name"], each["found"]) for each in document["recordings"]] == [
        ("U1-1", "damaged"),
        ("U1-3", "not_entered"),
        ("U1-0", "missing"),
        ("U1-4.incomplete", "unfinished"),
    ]
    assert document["sound"] == 1
    assert "bytes, expected" in document["recordings"][0]["reason"]
    assert sorted(path.name for path in root.iterdir()) == before


def test_a_plant_without_recordings_is_told_where_they_would_be_and_what_checks_others(plant_path):
    found = run(plant_path)

    assert found.exit_code == 0
    assert f"no recordings in {plant_path.parent / 'data' / 'captures'} or" in found.output
    assert "padwatch recording verify FOLDER" in found.output
    assert not (plant_path.parent / "data").exists()


def test_a_plants_database_is_copied_and_put_back(plant_path, tmp_path):
    data = tmp_path / "data"
    SqliteStore(data / "padwatch.sqlite3").close()
    open_access_file(data / "access.sqlite3").close()

    made = json.loads(padwatch("backup", plant_path, tmp_path / "copies", "--json").output)
    said = padwatch("backup", plant_path, tmp_path / "more", "--keep", "1")
    done = padwatch("restore", plant_path, made[0]["backup"], "--json")

    assert [found["n_bytes"] > 0 for found in made] == [True, True]
    assert (made[0]["n_rows"]["gap"], made[1]["n_rows"]["account"]) == (0, 0)
    assert said.exit_code == 0
    assert said.output.count("verified") == 2
    assert done.exit_code == 0
    restored = [found["database"] for found in json.loads(done.output)["restored"]]
    assert restored == [str(data / "padwatch.sqlite3"), str(data / "access.sqlite3")]


def test_without_a_copy_of_the_accounts_these_stay(plant_path, tmp_path):
    data = tmp_path / "data"
    SqliteStore(data / "padwatch.sqlite3").close()
    with closing(open_access_file(data / "access.sqlite3")) as people:
        people.accounts.add("anna", Role.ADMIN, "hash", 1)
    made = json.loads(padwatch("backup", plant_path, tmp_path / "copies", "--json").output)
    with closing(open_access_file(data / "access.sqlite3")) as people:
        people.accounts.add("bert", Role.ADMIN, "hash", 1)
    Path(made[1]["backup"]).unlink()

    said = padwatch("restore", plant_path, made[0]["backup"])

    assert said.exit_code == 0, said.output
    assert said.output.endswith("no copy of the accounts: they stay as they are\n")
    with closing(open_access_file(data / "access.sqlite3")) as people:
        assert [account.name for account in people.accounts.all()] == ["anna", "bert"]


def test_a_damaged_copy_of_the_accounts_leaves_both_databases(plant_path, tmp_path):
    data = tmp_path / "data"
    SqliteStore(data / "padwatch.sqlite3").close()
    open_access_file(data / "access.sqlite3").close()
    made = json.loads(padwatch("backup", plant_path, tmp_path / "copies", "--json").output)
    Path(made[1]["backup"]).write_bytes(Path(made[0]["backup"]).read_bytes())
    before = {path.name for path in data.iterdir()}

    said = padwatch("restore", plant_path, made[0]["backup"])

    assert said.exit_code == 1
    assert said.output.endswith("is not the access database of padwatch; choose another file\n")
    assert {path.name for path in data.iterdir()} == before


def test_what_was_taken_back_since_the_copy_is_not_given_again(plant_path, tmp_path):
    data = tmp_path / "data"
    database, made_ns = data / "access.sqlite3", time.time_ns()
    SqliteStore(data / "padwatch.sqlite3").close()
    with closing(open_access_file(database)) as people:
        for name in ("anna", "bert"):
            people.accounts.add(name, Role.ADMIN, "hash", made_ns)
        people.sessions.add(Session(b"d" * 32, "anna", made_ns, made_ns), 1, 0)
        create = Authenticator(people, SystemClock()).create_key
        keys = [create(name, Role.ADMIN, (), 1)[0] for name in ("old", "new")]
    made = json.loads(padwatch("backup", plant_path, tmp_path / "copies", "--json").output)
    with closing(open_access_file(database)) as people:
        people.keys.revoke(keys[0].id, made_ns)
        people.accounts.remove("bert", made_ns)

    said = padwatch("restore", plant_path, made[0]["backup"])

    assert said.exit_code == 0, said.output
    with closing(open_access_file(database)) as people:
        states = {key.name: key.state(made_ns) for key in people.keys.all()}
        assert states == {"old": KeyState.REVOKED, "new": KeyState.VALID}
        assert people.sessions.get(b"d" * 32) is None
    for words in (
        "all sessions are ended; accounts, with passwords of the copy: anna, bert",
        "accounts that did not exist before: bert (padwatch users remove)",
        f"valid keys: new ({keys[1].id}) (padwatch keys revoke)",
        f"keys revoked since the copy, and revoked again: {keys[0].id}",
    ):
        assert words in said.output


def test_what_cannot_be_copied_ends_with_one_line(deploy):
    found = padwatch("backup", deploy / "demo.toml", "/proc/nowhere")

    assert found.exit_code == 1
    assert found.output.startswith("padwatch backup: ")
    assert len(found.output.splitlines()) == 1
