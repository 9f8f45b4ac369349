"""The command line as a whole: exit codes, one line for people, no traceback."""

import json
import re
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch, padwatch_program

Changed = Callable[[str, str], tuple[str, int]]


@pytest.mark.parametrize("command", [("run",), ("config", "check"), ("daq",)], ids=" ".join)
def test_a_wrong_plant_file_ends_every_command_with_2_and_a_line_for_each_mistake(
    changed: Changed, tmp_path: Path, command: tuple[str, ...]
) -> None:
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


def test_a_plant_file_that_is_not_there_ends_with_2_in_one_line(tmp_path: Path) -> None:
    result = padwatch("run", tmp_path / "absent.toml")

    assert result.exit_code == 2
    assert result.stderr == f"{tmp_path / 'absent.toml'}: No such file or directory\n"


def test_a_port_in_use_is_one_line_and_exit_1(plant_path: Path, tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]

        result = padwatch("run", plant_path, "--port", port)

    assert result.exit_code == 1
    assert result.stderr == (
        f"padwatch: cannot listen on 127.0.0.1 port {port}: Address already in use\n"
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
def test_a_command_that_looks_says_that_there_is_no_database_and_makes_none(
    plant_path: Path, command: str
) -> None:
    places = {"PLANT": plant_path, "OUT.csv": plant_path.with_name("out.csv")}
    result = padwatch(*(places.get(word, word) for word in command.split()))
    assert result.exit_code == 1
    assert re.search("there is no (such )?database", result.stderr)
    assert [path.name for path in plant_path.parent.iterdir()] == ["plant.toml"]


def test_the_example_is_a_plant_file_that_passes_the_check(tmp_path: Path) -> None:
    path = tmp_path / "plant.toml"
    path.write_text(padwatch("config", "example").stdout, encoding="utf-8")

    result = padwatch_program("config", "check", "--json", path)

    assert result.exit_code == 0
    assert json.loads(result.stdout)["units"] >= 1


def test_the_schema_says_what_every_key_means() -> None:
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
