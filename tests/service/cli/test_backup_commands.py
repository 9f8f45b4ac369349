"""`padwatch backup` and `padwatch restore`, as they are typed."""

import json
import time
from contextlib import closing
from pathlib import Path

from rigs.command_line import padwatch

from service.api.auth.people import create_key
from service.store.access.identities import KeyState, Role, Session
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


def test_what_was_taken_back_since_the_copy_is_not_given_again(
    plant_path: Path, tmp_path: Path
) -> None:
    database = tmp_path / "data" / "padwatch.sqlite3"
    made_ns = time.time_ns()
    with closing(SqliteStore(database)) as store:
        people = store.access
        for name in ("anna", "bert"):
            people.accounts.add(name, Role.ADMIN, "hash", made_ns)
        people.sessions.add(Session(b"d" * 32, "anna", made_ns, made_ns), 1, 0)
        keys = [create_key(people, name, Role.ADMIN, (), 1, made_ns)[0] for name in ("old", "new")]
    made = json.loads(padwatch("backup", plant_path, tmp_path / "copies", "--json").output)
    with closing(SqliteStore(database)) as store:
        store.access.keys.revoke(keys[0].id, made_ns)
        store.access.accounts.remove("bert", made_ns)

    said = padwatch("restore", plant_path, made["backup"])

    assert said.exit_code == 0, said.output
    with closing(SqliteStore(database)) as store:
        states = {key.name: key.state(made_ns) for key in store.access.keys.all()}
        assert states == {"old": KeyState.REVOKED, "new": KeyState.VALID}
        assert store.access.sessions.get(b"d" * 32) is None
    for words in (
        "all sessions are ended; accounts, with passwords of the copy: anna, bert",
        "accounts that did not exist before: bert (padwatch users remove)",
        f"valid keys: new ({keys[1].id}) (padwatch keys revoke)",
        f"keys revoked since the copy, and revoked again: {keys[0].id}",
    ):
        assert words in said.output


def test_what_cannot_be_copied_ends_with_one_line(deploy: Path) -> None:
    found = padwatch("backup", deploy / "demo.toml", "/proc/nowhere")

    assert found.exit_code == 1
    assert found.output.startswith("padwatch backup: ")
    assert len(found.output.splitlines()) == 1
