"""`padwatch reference`, `audit` and `delivery` on the files of a plant."""

import asyncio
import csv
import hashlib
import hmac
import json
import sqlite3
from collections.abc import AsyncIterator, Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch, padwatch_program
from typer.testing import Result

from service.store.access.audit_entries import AuditAction
from service.store.access.audit_verification import head_path
from service.store.access.identities import Role
from service.store.sqlite import SqliteStore
from service.store.sqlite.store import open_access_file

OPTIONS = {"unit": "U1", "bearing": "UJB", "author": "A. Name", "x-um": 1998.5, "y-um": 2003.1}


def set_reference(run: Callable[..., Any], plant: Path, *flags: str, **changes: Any) -> Any:
    named = {name.replace("_", "-"): value for name, value in changes.items()}
    options = [f"--{name}={v}" for name, v in (OPTIONS | named).items() if v is not None]
    return run("reference", "set", plant, *options, *flags)


def test_what_was_set_is_listed_with_time_author_and_what_was_before(plant_path):
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
        ((), {"x_um": "nan"}, "gap x is nan µm; it must be above 0 and at most 10000 µm"),
        ((), {"opposite_x_um": 2000}, "bearing UJB has no opposite probe in x"),
        ((), {"bearing": "XJB"}, "unit U1: unknown bearing XJB; known bearings: UJB, LJB, TJB"),
        ((), {"unit": "U9"}, "unknown unit U9; known units: U1, U2"),
        (("--measured",), {"x_um": None, "y_um": None}, "no result is stored yet"),
        (("--measured",), {}, "padwatch reference set: give gaps or --measured, not both"),
    ],
    ids=lambda value: None if isinstance(value, str) else "-".join(value),
)
def test_a_wrong_reference_is_one_line_with_value_and_limit_and_leaves_nothing_behind(
    plant_path, flags, changes, said
):
    result = set_reference(padwatch, plant_path, *flags, **changes)

    assert result.exit_code == 2
    assert said in result.stderr
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert not (plant_path.parent / "data").exists()


def test_looking_at_references_creates_no_database(plant_path):
    result = padwatch("reference", "list", plant_path)

    assert result.exit_code == 0
    assert result.stderr == ""
    assert not (plant_path.parent / "data").exists()


@pytest.mark.parametrize("command", ["set", "list"])
def test_a_database_that_cannot_be_used_is_one_line_and_exit_1(plant_path, command):
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


T0 = 1_767_225_600_000_000_000
HOSTILE = ["=1+1", "+1", "-1", "@A1", "\t=1", " =1", "\r=1", "＝1+1", "|cmd", "'=1", "a\nb", "\x00"]


def audit(*arguments: object) -> Result:
    return padwatch("audit", *arguments)


@pytest.fixture
def database(plant_path: Path) -> Path:
    """A plant's database with an entry for each hostile name, and accounts with one entry."""
    path = plant_path.with_name("data") / "padwatch.sqlite3"
    with closing(SqliteStore(path)) as store:
        store.audit.record(
            [AuditAction(T0, name, "x", name, reason=name, after=name) for name in HOSTILE]
        )
    with closing(open_access_file(path.with_name("access.sqlite3"))) as access:
        access.accounts.add("anna", Role.ADMIN, "hash", T0 + 1)
    return path


def test_a_whole_trail_is_whole(plant_path, database):
    said, document = audit("verify", plant_path), audit("verify", plant_path, "--json")
    found = json.loads(document.stdout)
    assert (said.exit_code, document.exit_code) == (0, 0)
    first, second = said.stdout.splitlines()
    assert first.startswith(
        f"padwatch: {len(HOSTILE)} entries are intact; the hash of the last is "
    )
    assert second.startswith("access: 1 entries are intact; the hash of the last is ")
    assert found["is_whole"]
    for name, n_entries in (("padwatch", len(HOSTILE)), ("access", 1)):
        chain = found["chains"][name]
        assert (chain["is_whole"], chain["n_entries"], chain["finding"]) == (True, n_entries, None)
        head = head_path(database.with_name(f"{name}.sqlite3"))
        assert chain["hash"] == json.loads(head.read_text())["hash"]


@pytest.mark.parametrize(("name", "number"), [("padwatch", 4), ("access", 1)])
def test_an_altered_entry_of_either_chain_is_named(plant_path, database, name, number):
    with closing(sqlite3.connect(database.with_name(f"{name}.sqlite3"))) as other:
        other.execute("DROP TRIGGER audit_kept_as_told")
        other.execute("UPDATE audit SET actor = 'x' WHERE number = ?", (number,))
        other.commit()
    said, document = audit("verify", plant_path), audit("verify", plant_path, "--json")
    assert (said.exit_code, document.exit_code) == (1, 1)
    assert f"{name}: CORRUPT: entry {number} was altered\n" in said.stdout
    found = json.loads(document.stdout)
    assert not found["is_whole"]
    assert [each for each, chain in found["chains"].items() if not chain["is_whole"]] == [name]
    assert found["chains"][name]["finding"]["number"] == number


def test_a_chain_that_was_taken_away_is_not_whole(plant_path, database):
    database.with_name("access.sqlite3").unlink()
    said = audit("verify", plant_path)
    assert said.exit_code == 1
    assert "access.sqlite3: the database does not exist" in said.output


def test_a_restored_backup_can_be_said_to_be_known(plant_path, database):
    head_path(database).unlink()
    store = SqliteStore(database)
    store.audit.record([AuditAction(T0, "A", "x", "y")])
    store.close()
    number = len(HOSTILE) + 1
    unknown, known = (
        audit("verify", plant_path),
        audit("verify", plant_path, f"--known=padwatch:{number}"),
    )
    assert (unknown.exit_code, known.exit_code) == (1, 0)
    other = audit("verify", plant_path, f"--known=access:{number}")
    assert other.exit_code == 2
    assert f"--known access:{number}: no such entry reports a restored backup" in other.stderr
    assert f"entry {number} reports that the head file did not match" in unknown.stdout


def test_an_export_holds_nothing_that_a_spreadsheet_computes(plant_path, database):
    out = plant_path.with_name("audit.csv")
    said = audit("export", plant_path, out)
    with out.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)

    assert (said.exit_code, said.stdout) == (0, f"{out}: {len(HOSTILE) + 1} entries\n")
    assert header[:5] == ["time", "chain", "number", "time_ns", "actor"]
    assert [row[1] for row in rows] == ["padwatch"] * len(HOSTILE) + ["access"]
    assert [row[4].removeprefix("'") for row in rows[:-1]] == [
        name.removeprefix("'" if name != "'=1" else "").replace("\0", "\ufffd") for name in HOSTILE
    ]
    for row in rows:
        for cell in row:
            assert not cell.strip().startswith(("=", "+", "-", "@", "|", "＝")), row
    assert database.exists()


def test_an_export_never_overwrites(plant_path, database):
    out = plant_path.with_name("audit.csv")
    out.write_text("mine")
    assert audit("export", plant_path, out).exit_code == 1
    assert audit("export", plant_path, out.with_suffix(".xls")).exit_code == 2
    assert out.read_text() == "mine"
    assert database.exists()


RECEIVER = """
[delivery]
dashboard_url = "https://padwatch.example/"
[[delivery.receiver]]
kind = "webhook"
id = "desk"
url = "http://127.0.0.1:{port}/"
secret = {{ file = "{secret}" }}
"""


@pytest.fixture
async def desk(plant_path: Path) -> AsyncIterator[dict[str, Any]]:
    """A web server with the plant file that names it; answers what it is told to."""
    found: dict[str, Any] = {"answer": "200 OK", "requests": [], "plant": plant_path}

    async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        head = (await reader.readuntil(b"\r\n\r\n")).decode().lower().split("\r\n")
        headers = dict(line.split(": ", 1) for line in head[1:-2])
        body = await reader.readexactly(int(headers["content-length"]))
        found["requests"].append((headers, body))
        writer.write(f"HTTP/1.1 {found['answer']}\r\n\r\n".encode())
        writer.close()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    secret = plant_path.with_name("secret")
    secret.write_text("s3cret\n")
    receiver = RECEIVER.format(port=server.sockets[0].getsockname()[1], secret=secret)
    plant_path.write_text(plant_path.read_text(encoding="utf-8") + receiver, encoding="utf-8")
    yield found
    server.close()
    await server.wait_closed()


async def test_a_test_message_arrives_signed_and_says_that_it_is_one(desk):
    done = await asyncio.to_thread(padwatch_program, "delivery", "test", desk["plant"], "desk")

    assert done == (0, "desk: delivered: 200\n", "")
    ((headers, body),) = desk["requests"]
    message = json.loads(body)
    assert (message["type"], message["plant"]) == ("test", "Demo plant")
    assert message["url"] == "https://padwatch.example/#/alarms"
    signed = headers["padwatch-timestamp"].encode() + b"." + body
    signature = hmac.new(b"s3cret", signed, hashlib.sha256).hexdigest()
    assert headers["padwatch-signature"] == f"v1={signature}"


@pytest.mark.parametrize(
    ("answer", "outcome"), [("401 No", "refused"), ("503 Away", "not delivered")]
)
async def test_a_test_message_that_is_not_taken_says_why(answer, outcome, desk):
    desk["answer"] = answer
    command = ("delivery", "test", desk["plant"], "desk", "--json")
    done = await asyncio.to_thread(padwatch, *command)

    assert done.exit_code == 1
    (found,) = json.loads(done.stdout)
    assert (found["outcome"], found["answer"]) == (outcome, answer[:3])


@pytest.mark.parametrize(
    ("command", "receiver", "code", "said"),
    [
        ("test", "office", 2, "unknown receiver office; known receivers: desk"),
        ("retry", "desk", 1, "the database does not exist"),
    ],
)
async def test_what_needs_a_receiver_or_a_database_is_refused_without(
    desk, command, receiver, code, said
):
    done = await asyncio.to_thread(padwatch, "delivery", command, desk["plant"], receiver)

    assert done.exit_code == code
    assert said in done.stderr
