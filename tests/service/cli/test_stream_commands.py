"""`padwatch acquire`, `analyse` and `serve` say what they need."""

from pathlib import Path

import pytest
from rigs.command_line import padwatch

from service.cli.run import NEEDS_POSTGRESQL

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
def test_what_is_missing_or_wrong_is_refused_with_what_to_do(
    plant_path: Path, command: str, stream: str, options: tuple[str, ...], words: str
) -> None:
    plant_path.write_text(f"{plant_path.read_text()}\n{stream}")
    done = padwatch(command, plant_path, *options)
    assert done.exit_code == 2
    assert words in done.output
