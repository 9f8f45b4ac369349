"""`FailingCalls`: lets the n-th call of a kind fail, once or for ever, in a running process."""

import os
import pickle
import signal
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import pytest

from harness.deeds import AuditAction
from harness.tape import environment, python

PATIENCE_S = 120.0


@dataclass(frozen=True)
class Case:
    """The n-th system call of a kind, counted from 1, fails with an error such as ``EIO``."""

    call: str
    error: str
    number: int
    is_for_ever: bool

    def __str__(self) -> str:
        return f"{self.call}:error={self.error}:when={self.number}{'+' * self.is_for_ever}"


@dataclass(frozen=True)
class Outcome:
    """What a process has come to.

    Parameters
    ----------
    acknowledged
        Number of the newest transaction that it said is durable; -1 for none.
    """

    exit_code: int
    acknowledged: int
    errors: tuple[str, ...]


class FailingCalls:
    """Runs processes of `harness.enduring` under strace."""

    def __init__(self, server: subprocess.Popen[str]) -> None:
        self._server = server

    def run(self, folder: Path, *inject: str) -> Outcome:
        """Let one process work in a folder, which may be there already, with calls that fail."""
        (folder / "data").mkdir(parents=True, exist_ok=True)
        self._tell(str(folder))
        pid = int(self._line())
        _wait_until_stopped(pid)
        options = [word for one in inject for word in ("-e", f"inject={one}")]
        command = ["strace", "-f", "-o", str(folder / "tape"), *options, "-p", str(pid)]
        strace = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
        try:
            assert strace.stderr is not None
            said = strace.stderr.readline()
            os.kill(pid, signal.SIGCONT)
            if "attached" not in said:
                pytest.skip(f"strace cannot be attached here: {said}")
            code = int(self._line().removeprefix("END "))
        finally:
            strace.wait(PATIENCE_S)
            if strace.stderr is not None:
                strace.stderr.close()
        acks = (folder / "acks").read_text().split()
        errors = tuple((folder / "errors").read_text().splitlines())
        return Outcome(code, int(acks[-1]) if acks else -1, errors)

    def _tell(self, line: str) -> None:
        stdin: IO[str] | None = self._server.stdin
        assert stdin is not None
        stdin.write(f"{line}\n")
        stdin.flush()

    def _line(self) -> str:
        assert self._server.stdout is not None
        return self._server.stdout.readline().strip()


@contextmanager
def failing_calls(folder: Path, deeds: Sequence[AuditAction]) -> Iterator[FailingCalls]:
    """Start what processes are begun from."""
    with (folder / "deeds").open("wb") as file:
        pickle.dump(list(deeds), file)
    server = subprocess.Popen(
        python("-m", "harness.enduring", folder / "deeds", "-"),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    try:
        yield FailingCalls(server)
    finally:
        assert server.stdin is not None
        assert server.stdout is not None
        server.stdin.close()
        server.wait(PATIENCE_S)
        server.stdout.close()


def n_calls(tape: Path, call: str) -> int:
    """How many calls of a kind a process has made."""
    with tape.open(errors="replace") as lines:
        return sum(f" {call}(" in line for line in lines)


def _wait_until_stopped(pid: int) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T":
            return
        time.sleep(0.005)
    raise AssertionError(f"process {pid} does not stop")
