"""`ServiceRig`: the real program, started, watched, killed and started again."""

import http.client
import json
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

import psutil

from harness.tape import environment, python

PATIENCE_S = 120.0
"""Until a test gives up on a busy machine; nothing waits so long when all is well."""


class RefusedError(Exception):
    """The service answered with something else than 2xx."""

    def __init__(self, status: int, body: str) -> None:
        super().__init__(f"{status}: {body[:300]}")
        self.status = status


class Api:
    """One connection to a service; what goes wrong with it is an OSError or an HTTPException."""

    def __init__(self, url: str, timeout_s: float = 10.0) -> None:
        self._at = urlsplit(url).netloc
        self._timeout_s = timeout_s
        self._connection = http.client.HTTPConnection(self._at, timeout=timeout_s)

    def get(self, path: str) -> Any:
        """Ask for something; the answer as JSON."""
        return self._ask("GET", path, None)

    def post(self, path: str, body: dict[str, Any]) -> Any:
        """Ask for something to be done."""
        return self._ask("POST", path, json.dumps(body))

    def _ask(self, method: str, path: str, body: str | None) -> Any:
        headers = {} if body is None else {"Content-Type": "application/json"}
        try:
            self._connection.request(method, path, body, headers)
            answer = self._connection.getresponse()
            text = answer.read().decode()
        except (OSError, http.client.HTTPException):
            self._connection.close()
            raise
        if not 200 <= answer.status < 300:
            raise RefusedError(answer.status, text)
        return json.loads(text)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()


UNREACHABLE = (OSError, http.client.HTTPException)


class ServiceRig:
    """One `padwatch run` after another on the same plant file; or another role.

    Parameters
    ----------
    program
        Module that is run instead of the command.
    before
        Words before the interpreter, such as ``strace``.
    role
        What the program is to do, and its options.
    log
        Name of the file beside the plant file that takes its log.
    """

    def __init__(
        self,
        plant_file: Path,
        program: str = "harness.open_program",
        before: tuple[str, ...] = (),
        environment: dict[str, str] | None = None,
        role: tuple[str, ...] = ("run",),
        log: str = "service.log",
    ) -> None:
        self._plant_file, self._program, self._before = plant_file, program, before
        self._environment = environment or {}
        self._role = role
        self.log = plant_file.with_name(log)
        self.process: subprocess.Popen[str] | None = None
        self.url = ""
        self.started_s = 0.0

    @property
    def pid(self) -> int:
        """Of the running service."""
        assert self.process is not None
        return self.process.pid

    def start(self) -> None:
        """Start it; returns at once."""
        assert self.process is None
        role, *options = self._role
        command = python("-m", self._program, role, self._plant_file, "--port", 0)
        with self.log.open("a", encoding="utf-8") as log:
            self.process = subprocess.Popen(
                [*self._before, *command, *options],
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                env=environment() | {"PYTHONUNBUFFERED": "1"} | self._environment,
            )
        self.started_s = time.monotonic()
        self.url = ""

    def wait_ready(self) -> float:
        """Wait until it says that it is ready; seconds since the start."""
        assert self.process is not None
        assert self.process.stdout is not None
        for line in self.process.stdout:
            if line.startswith("padwatch") and ": http" in line:
                self.url = line.split()[-1].removesuffix("readyz").rstrip("/")
                return time.monotonic() - self.started_s
        raise AssertionError(f"the service did not start: {self.newest_log()}")

    def api(self) -> Api:
        """A connection to it."""
        return Api(self.url)

    def kill(self) -> None:
        """Kill -9 of the measuring process, which is the program; its serving process ends, too."""
        children: list[psutil.Process] = []
        if self.process is not None:
            with suppress(psutil.NoSuchProcess):  # it has ended by itself
                children = psutil.Process(self.pid).children()
        self._end(signal.SIGKILL)
        _, alive = psutil.wait_procs(children, PATIENCE_S)
        assert not alive, f"still running after the kill: {alive}"

    def kill_serving(self) -> int:
        """Kill -9 of the serving process, if it runs; its process id, or 0."""
        for child in psutil.Process(self.pid).children():
            with suppress(psutil.NoSuchProcess):  # it has ended meanwhile
                child.kill()
                return child.pid
        return 0

    def stop(self) -> int:
        """Ask it to end; its exit code."""
        return self._end(signal.SIGTERM)

    def processes(self) -> list[psutil.Process]:
        """Return the program and, in the role ``run``, its serving process."""
        program = psutil.Process(self.pid)
        return [program, *program.children()]

    def signal(self, number: int) -> None:
        """Send a signal, such as SIGSTOP, to all processes of the program."""
        for process in self.processes():
            process.send_signal(number)

    def newest_log(self) -> str:
        """The end of what it has logged."""
        return self.log.read_text(encoding="utf-8")[-3000:] if self.log.exists() else ""

    def _end(self, number: int) -> int:
        process, self.process = self.process, None
        if process is None:
            return 0
        process.send_signal(number)
        try:
            return process.wait(PATIENCE_S)
        finally:
            process.kill()
            process.wait()
            if process.stdout is not None:
                process.stdout.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()


def until(look: Any, within_s: float = PATIENCE_S) -> Any:
    """Look until there is something; what is unreachable is looked for again."""
    end_s = time.monotonic() + within_s
    found = None
    while time.monotonic() < end_s:
        try:
            found = look()
        except (*UNREACHABLE, RefusedError):
            found = None
        if found:
            return found
        time.sleep(0.05)
    raise AssertionError(f"{look} never came to be so")
