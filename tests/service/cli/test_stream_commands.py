"""`padwatch acquire`, `analyse` and `serve` say what they need."""

from pathlib import Path

import pytest
from rigs.command_line import padwatch

from service.cli.serve import NEEDS_POSTGRESQL

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"


@pytest.mark.parametrize("command", ["acquire", "analyse"])
def test_a_plant_file_without_a_stream_is_refused_with_what_to_do(command: str) -> None:
    done = padwatch(command, DEMO)
    assert done.exit_code == 2
    assert "no [stream]" in done.output
    assert "padwatch run" in done.output


@pytest.fixture
def plant_file(tmp_path: Path) -> Path:
    path = tmp_path / "plant.toml"
    # no server is there, and none is asked before the mistake is found
    path.write_text(DEMO.read_text() + '\n[stream]\nservers = ["nats://127.0.0.1:1"]\n')
    return path


@pytest.mark.parametrize(
    ("partition", "words"), [("2", "such as 1/2"), ("3/2", "such as 1/2"), ("3/3", "empty")]
)
def test_a_share_that_is_none_is_refused_with_what_to_write(
    plant_file: Path, partition: str, words: str
) -> None:
    done = padwatch("analyse", plant_file, "--partition", partition)
    assert done.exit_code == 2
    assert words in done.output


def test_an_unknown_unit_is_refused_with_those_that_there_are(plant_file: Path) -> None:
    done = padwatch("acquire", plant_file, "--unit", "U9")
    assert done.exit_code == 2
    assert "no unit 'U9'; known are U1, U2" in done.output


def test_a_secret_in_the_address_of_a_server_is_refused(plant_file: Path) -> None:
    text = plant_file.read_text().replace("nats://127", "nats://user:secret@127")
    plant_file.write_text(text)
    done = padwatch("acquire", plant_file)
    assert done.exit_code == 2
    assert "servers" in done.output


def test_a_plant_without_postgresql_is_not_served_apart() -> None:
    done = padwatch("serve", DEMO, "--port", "0")
    assert done.exit_code == 2
    assert NEEDS_POSTGRESQL in done.output
