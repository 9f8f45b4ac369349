"""The command line, in the test's own process and as a program of its own."""

import socket
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

from typer.testing import CliRunner, Result

from service.cli.commands import app

ROOT = Path(__file__).parents[3]


OPEN = """
from functools import partial
from service.cli import processes
processes.run_plant = partial(processes.run_plant, is_demo=True)
from service.cli.main import main
main()
"""
"""The command, whose `run` asks nobody on this computer to log in, as `padwatch demo` does."""


class Ended(NamedTuple):
    """A program that has ended; fields as in `Result`."""

    exit_code: int
    stdout: str
    stderr: str


def padwatch(*arguments: object) -> Result:
    """Run a command in this process, which must not serve: a service ends its process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def padwatch_program(*arguments: object, cwd: Path | None = None) -> Ended:
    """Run a command as a program, which takes two seconds of processor time."""
    done = subprocess.run(
        [sys.executable, "-m", "service.cli.main", *map(str, arguments)],
        capture_output=True,
        text=True,
        env={"PYTHONPATH": str(ROOT), "PATH": ""},
        cwd=cwd,
        check=False,
    )
    return Ended(done.returncode, done.stdout, done.stderr)


def free_port() -> int:
    """Port of loopback at which nobody listens just now."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port
