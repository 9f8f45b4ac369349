"""The install guide names files and commands that there are."""

import re
from pathlib import Path

from typer.testing import CliRunner

from service.cli.commands import app

ROOT = Path(__file__).parents[2]
GUIDE = (ROOT / "docs" / "install.md").read_text(encoding="utf-8")


def test_every_file_that_the_package_is_said_to_carry_is_there() -> None:
    named = set(re.findall(r"/opt/padwatch/share/padwatch/([\w./-]+\w)", GUIDE))

    assert {"systemd/padwatch.service", "proxy/nginx.conf"} <= named
    assert [name for name in named if not (ROOT / "deploy" / name).is_file()] == []


def test_every_file_of_the_checkout_that_is_named_is_there() -> None:
    named = set(re.findall(r"(?<![\w/])((?:deploy|requirements)/[\w./-]+\w)", GUIDE))

    assert {"requirements/run.txt", "deploy/container/Containerfile"} <= named
    assert [name for name in named if not (ROOT / name).is_file()] == []


def test_every_command_that_is_typed_is_one_of_padwatch() -> None:
    typed = set(re.findall(r"/bin/padwatch ([a-z]+(?: (?:check|example))?)", GUIDE))

    assert {"validate", "config example", "config check", "restore"} <= typed
    for command in typed:
        helped = CliRunner().invoke(app, [*command.split(), "--help"])
        assert helped.exit_code == 0, command
