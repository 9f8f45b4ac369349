"""The systemd units are hardened and understood; the install guide names what there is."""

import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest
from typer.testing import CliRunner

from service.cli.commands import app

UNITS = Path(__file__).parents[2] / "deploy" / "systemd"
SERVICES = sorted(path.name for path in UNITS.glob("*.service"))
MAX_EXPOSURE = 1.5


def systemd(*command: str) -> str:
    """Run one of systemd's commands; what it says."""
    if shutil.which(command[0]) is None:
        pytest.skip("needs systemd")
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    return done.stdout + done.stderr


def settings(name: str) -> dict[str, list[str]]:
    """What a unit file assigns, by key."""
    found: dict[str, list[str]] = {}
    for line in (UNITS / name).read_text(encoding="utf-8").splitlines():
        if "=" in line and not line.startswith("#"):
            key, _, value = line.partition("=")
            found.setdefault(key, []).append(value)
    return found


def test_there_is_a_service_in_one_or_several_processes_and_a_backup_every_night():
    roles = ["padwatch-acquire.service", "padwatch-analyse@.service", "padwatch-serve.service"]
    assert sorted(["padwatch.service", "padwatch-backup.service", *roles]) == SERVICES
    assert settings("padwatch-backup.timer")["OnCalendar"]


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_is_hardly_exposed(name, tmp_path):
    instance = tmp_path / name.replace("@", "@1-2")
    instance.write_bytes((UNITS / name).read_bytes())

    said = systemd("systemd-analyze", "--no-pager", "security", "--offline=true", str(instance))

    level = re.search(r"Overall exposure level for \S+: ([0-9.]+)", said)
    assert level is not None, said
    assert float(level[1]) <= MAX_EXPOSURE


@pytest.mark.parametrize("name", [*SERVICES, "padwatch-backup.timer"])
def test_systemd_understands_every_line_of_a_unit(name, tmp_path):
    for path in UNITS.glob("padwatch*.*"):
        text = path.read_text(encoding="utf-8")
        text = re.sub(r"^ExecStart=\S+", "ExecStart=/bin/true", text, flags=re.MULTILINE)
        (tmp_path / path.name).write_text(text, encoding="utf-8")

    instance = tmp_path / name.replace("@", "@1-2")
    instance.write_bytes((tmp_path / name).read_bytes())

    said = systemd("systemd-analyze", "--no-pager", "verify", "--man=no", str(instance))

    assert [line for line in said.splitlines() if "padwatch" in line] == []


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_runs_a_command_that_there_is(name):
    (line,) = settings(name)["ExecStart"]
    program, command, *options = shlex.split(line)
    helped = CliRunner().invoke(app, [command, "--help"])

    assert program == "/opt/padwatch/bin/padwatch"
    assert helped.exit_code == 0
    assert all(option in helped.output for option in options if option.startswith("--"))


def test_the_end_of_the_serving_process_is_left_to_the_measuring_one():
    found = settings("padwatch.service")

    assert found["KillMode"] == ["mixed"]
    assert found["OOMPolicy"] == ["continue"]


@pytest.mark.parametrize("name", [name for name in SERVICES if name != "padwatch-backup.service"])
def test_the_service_is_watched_and_begins_anew(name):
    found = settings(name)

    assert found["Type"] == ["notify"]
    assert found["WatchdogSec"] == ["30"]
    assert found["Restart"] == ["always"]
    assert found["User"] == ["padwatch"]


def test_the_user_of_the_services_is_made(tmp_path):
    (tmp_path / "etc").mkdir()
    said = systemd("systemd-sysusers", f"--root={tmp_path}", str(UNITS / "padwatch.sysusers.conf"))

    passwd = tmp_path / "etc" / "passwd"
    assert passwd.exists(), said
    assert "padwatch:x:" in passwd.read_text(encoding="utf-8")


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
def test_every_file_that_is_named_is_there(where, folder, known):
    named = set(re.findall(where, GUIDE))

    assert known in named
    assert [name for name in named if not (ROOT / folder / name).is_file()] == []


def test_every_command_that_is_typed_is_one_of_padwatch():
    typed = set(re.findall(r"/bin/padwatch ([a-z]+(?: (?:check|example))?)", GUIDE))

    assert {"validate", "config example", "config check", "restore"} <= typed
    for command in typed:
        helped = CliRunner().invoke(app, [*command.split(), "--help"])
        assert helped.exit_code == 0, command
