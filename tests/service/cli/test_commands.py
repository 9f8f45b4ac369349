"""The command line as a whole: exit codes, one line for people, and commands on a server."""

import json
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import pytest
import typer
from harness.places import PostgresPlace
from rigs.command_line import padwatch, padwatch_program

from service.cli import commands, main, options
from service.cli.processes import NEEDS_POSTGRESQL


@pytest.mark.parametrize("command", [("run",), ("config", "check"), ("daq",)], ids=" ".join)
def test_a_wrong_plant_file_ends_commands_with_2_and_a_line_a_mistake(changed, tmp_path, command):
    text, line = changed("bracket_stiffness_n_per_m = 1.18e9", "bracket_stiffness_n_per_m = 1.18")
    path = tmp_path / "plant.toml"
    path.write_text(text, encoding="utf-8")

    result = padwatch(*command, path)

    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.startswith(
        f"{path}:{line}: unit[1].bearing[1].bracket_stiffness_n_per_m = 1.18: "
    )
    assert result.stderr.count("\n") == 1


def test_a_plant_file_that_is_not_there_ends_with_2_in_one_line(tmp_path):
    result = padwatch("run", tmp_path / "absent.toml")

    assert result.exit_code == 2
    assert result.stderr == f"{tmp_path / 'absent.toml'}: No such file or directory\n"


def test_a_port_in_use_is_one_line_and_exit_1(plant_path, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]

        result = padwatch("run", plant_path, "--port", port)

    assert result.exit_code == 1
    assert result.stderr == (
        f"padwatch run: cannot listen on 127.0.0.1 port {port}: Address already in use\n"
    )
    assert result.stdout == ""
    assert not (tmp_path / "data").exists()


@pytest.mark.parametrize(
    "command",
    [
        *("users list PLANT", "users remove PLANT anna", "users role PLANT anna admin"),
        *("keys list PLANT", "keys revoke PLANT 000000000000"),
        *("audit verify PLANT", "audit export PLANT OUT.csv"),
        *("store check PLANT", "readings export PLANT OUT.csv"),
    ],
)
def test_a_command_that_looks_says_that_there_is_no_database_and_makes_none(plant_path, command):
    places = {"PLANT": plant_path, "OUT.csv": plant_path.with_name("out.csv")}
    result = padwatch(*(places.get(word, word) for word in command.split()))
    assert result.exit_code == 1
    assert re.search("the database does not exist", result.stderr)
    assert [path.name for path in plant_path.parent.iterdir()] == ["plant.toml"]


def test_the_example_is_a_plant_file_that_passes_the_check(tmp_path):
    path = tmp_path / "plant.toml"
    path.write_text(padwatch("config", "example").stdout, encoding="utf-8")

    result = padwatch_program("config", "check", "--json", path)

    assert result.exit_code == 0
    assert json.loads(result.stdout)["units"] >= 1


def test_the_schema_says_what_every_key_means():
    schema = json.loads(padwatch("config", "schema").stdout)

    assert schema["type"] == "object"
    assert set(schema["properties"]) == {
        *("plant", "service", "analysis", "alarms", "films", "capture", "evidence"),
        *("access", "delivery", "spectra", "unit"),
        *("store", "stream", "space", "retention", "recording"),
    }
    keys = list(_keys(schema))
    assert len(keys) > 60
    assert [name for name, key in keys if len(key.get("description", "")) < 10] == []
    for reference in re.findall(r'"#/\$defs/(\w+)"', json.dumps(schema)):
        assert reference in schema["$defs"]


def _keys(schema: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for model in [schema, *schema["$defs"].values()]:
        for name, key in model.get("properties", {}).items():
            yield f"{model.get('title')}.{name}", key


WAITS_FOR_EVER = """
import asyncio, threading
from service.runtime.process import run_to_its_end

async def program():
    begun = threading.Event()
    def work():
        begun.set()
        threading.Event().wait()
    asyncio.create_task(asyncio.to_thread(work))
    await asyncio.to_thread(begun.wait)
    print("over", flush=True)

run_to_its_end(program())
"""

ENDS_WITH_3 = """
import atexit
from service.cli import commands, main, options

def app():
    atexit.register(print, "taken down")
    print("said", end="")
    raise SystemExit(3)

commands.app = app
main.main()
"""


def python(program: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )


def test_a_thread_without_end_does_not_hold_the_end_up():
    ended = python(WAITS_FOR_EVER)

    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("over")
    assert "threads are still running" in ended.stdout + ended.stderr


def test_a_command_ends_with_its_code_before_libraries_are_taken_down():
    ended = python(ENDS_WITH_3)

    assert (ended.returncode, ended.stdout) == (3, "said"), ended.stderr


@pytest.mark.parametrize(
    ("raised", "expected"),
    [(None, 0), (SystemExit(0), 0), (SystemExit(None), 0), (SystemExit("why"), 1), (OSError(), 70)],
    ids=repr,
)
def test_every_end_of_a_command_has_its_exit_code(monkeypatch, raised, expected):
    def app() -> None:
        if raised is not None:
            raise raised

    codes: list[int] = []
    monkeypatch.setattr(commands, "app", app)
    monkeypatch.setattr(main, "leave", codes.append)
    main.main()

    assert codes == [expected]


HELP_LOADS = """
import sys
from service.cli import main
main.leave = lambda code: None
sys.argv = ["padwatch", "--help"]
main.main()
print("loaded", *sorted({name.partition(".")[0] for name in sys.modules}))
"""


def test_the_help_of_all_commands_loads_none_of_them():
    ended = python(HELP_LOADS)

    *text, loaded = ended.stdout.splitlines()
    assert any(line.split()[:1] == ["reanalyse"] for line in text), ended.stderr
    assert not {"numpy", "scipy", "fastapi", "pydantic", "structlog"} & set(loaded.split())


def test_the_help_of_all_commands_is_that_of_each_command():
    group = typer.main.get_command(commands.app)
    loaded = dict(group.commands.items())
    for width in (60, 80, 200):
        formatter = typer.Context(group).make_formatter()
        formatter.width = width
        group.format_commands(typer.Context(group), formatter)
        listed = formatter.getvalue()
        limit = width - 6 - max(map(len, loaded))
        for name, command in loaded.items():
            words = f"{name} {command.get_short_help_str(limit)}".split()
            assert " ".join(words) in " ".join(listed.split())
        assert [line for line in listed.splitlines() if line.endswith(":")] == [
            f"{heading}:" for heading in commands.GROUPS
        ]


def command_paths() -> Iterator[tuple[str, ...]]:
    """Every command and group of commands, as words after `padwatch`."""

    def below(command: Any, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        yield path
        for name, its in getattr(command, "commands", {}).items():
            yield from below(its, (*path, name))

    return below(typer.main.get_command(commands.app), ())


def test_every_command_has_a_help_text():
    paths = list(command_paths())
    for path in paths:
        shown = padwatch(*path, "--help")
        assert (shown.exit_code, shown.stderr) == (0, ""), path
        assert " ".join(path) in shown.stdout
    assert len(paths) > 40


def test_the_version_is_that_of_the_package():
    shown = padwatch("--version")
    assert (shown.exit_code, shown.stdout) == (0, f"padwatch {version('padwatch')}\n")


def test_every_error_with_an_exit_code_exists():
    for name in options.EXIT_CODES:
        module, _, error = name.rpartition(".")
        assert issubclass(resolve_name(f"{module}:{error}"), Exception)


@pytest.fixture
def server_plant(plant_path: Path, postgres_place: PostgresPlace) -> Path:
    """A plant file that names the database; its data folder is empty."""
    text, address = plant_path.read_text(), postgres_place.address.conninfo
    plant_path.write_text(f'{text}\n[store]\npostgresql = "{address}"\n')
    return plant_path


def run(*arguments: object, exit_code: int = 0) -> str:
    """Run a command; what it says."""
    done = padwatch(*arguments)
    assert done.exit_code == exit_code, done.output
    return done.output


def test_commands_work_on_a_postgresql_server_and_make_no_file(server_plant, tmp_path):
    run("keys", "create", server_plant, "wall", "--role", "viewer")
    gaps = ("--x-um", "2000", "--y-um", "2001")
    place = ("--unit", "U1", "--bearing", "UJB")
    run("reference", "set", server_plant, *place, *gaps, "--author", "Ada")
    assert "wall" in run("keys", "list", server_plant)
    assert "2 entries" in run("audit", "verify", server_plant)
    assert "2001" in run("reference", "list", server_plant)
    assert not list(tmp_path.rglob("*.sqlite3"))


def test_copies_are_left_to_the_servers_own_tools(server_plant, tmp_path):
    for arguments in (
        ("backup", server_plant, tmp_path),
        ("restore", server_plant, tmp_path / "copy"),
    ):
        said = run(*arguments, exit_code=1)
        assert "must be copied with pg_dump or pg_basebackup" in said
        assert len(said.strip().splitlines()) == 1


NO_STREAM = "no [stream]: add one with the servers of NATS, or use `padwatch run`"

# no server is there, and none is asked before the mistake is found
STREAM = '[stream]\nservers = ["nats://127.0.0.1:1"]\n'
SECRET = STREAM.replace("nats://", "nats://user:secret@")


@pytest.mark.parametrize(
    ("command", "stream", "options", "words"),
    [
        ("acquire", "", (), NO_STREAM),
        ("analyse", "", (), NO_STREAM),
        ("analyse", STREAM, ("--partition", "2"), "such as 1/2"),
        ("analyse", STREAM, ("--partition", "3/2"), "such as 1/2"),
        ("analyse", STREAM, ("--partition", "3/3"), "empty"),
        ("acquire", STREAM, ("--unit", "U9"), "unknown unit 'U9'; known units: U1, U2"),
        ("acquire", SECRET, (), "servers"),
        ("serve", "", ("--port", "0"), NEEDS_POSTGRESQL),
    ],
)
def test_missing_or_wrong_input_is_refused_with_advice(plant_path, command, stream, options, words):
    plant_path.write_text(f"{plant_path.read_text()}\n{stream}")
    done = padwatch(command, plant_path, *options)
    assert done.exit_code == 2
    assert words in done.output
