"""The install guide names files and commands that there are."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.cli.commands import app

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("where", "folder", "known"),
    [
        (r"/opt/padwatch/share/padwatch/([\w./-]+\w)", "deploy", "systemd/padwatch.service"),
        (r"(?<![\w/])((?:deploy|requirements)/[\w./-]+\w)", "", "requirements/run.txt"),
    ],
    ids=["in the package", "in the checkout"],
)
def test_every_file_that_is_named_is_there(where: str, folder: str, known: str) -> None:
    named = set(re.findall(where, GUIDE))

    assert known in named
    assert [name for name in named if not (ROOT / folder / name).is_file()] == []


def test_every_command_that_is_typed_is_one_of_padwatch() -> None:
    typed = set(re.findall(r"/bin/padwatch ([a-z]+(?: (?:check|example))?)", GUIDE))

    assert {"validate", "config example", "config check", "restore"} <= typed
    for command in typed:
        helped = CliRunner().invoke(app, [*command.split(), "--help"])
        assert helped.exit_code == 0, command
