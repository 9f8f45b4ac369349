"""The program as a user runs it: a real process, asked over HTTP."""

import asyncio
import os
import signal
import ssl
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import httpx2
import pytest

ROOT = Path(__file__).parents[2]
DEMO = ROOT / "deploy" / "demo.toml"
PATIENCE_S = 240.0
"""Until a test gives up; no test waits that long when all is well."""

TLS = ssl.create_default_context()
"""Loaded once: a client for each question would load all certificates for each."""

WIRE = 'kind = "modbus_ring"\nhost = "127.0.0.1"\nport = {port}\n'
SERVING = "service.app.serving_process"
"""Part of the command line of a serving process."""

ABSENT: Mapping[str, int] = {"U1": 1, "U2": 1}
"""Ports of two units at which nobody listens."""


class Program:
    """A running `padwatch` and what it has said so far."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.said: list[str] = []
        self.errors = ""
        self.url = ""
        self._reading = asyncio.create_task(self._read_errors())

    @property
    def pid(self) -> int:
        return self.process.pid

    async def wait_for_url(self, patience_s: float = PATIENCE_S) -> str:
        """Read what it prints until the URL comes; of a unix socket it has no host."""
        assert self.process.stdout is not None
        async with asyncio.timeout(patience_s):
            while line := (await self.process.stdout.readline()).decode():
                self.said.append(line)
                if line.startswith(("padwatch: http", "padwatch: unix:")):
                    self.url = line.removeprefix("padwatch: ").strip().rstrip("/")
                    return self.url
        raise AssertionError(f"ended without a URL: {self.said} {self.errors}")

    async def wait_for_token(self) -> str:
        """Read the token for the first account, which comes after the URL where there is none."""
        assert self.process.stdout is not None
        async with asyncio.timeout(PATIENCE_S):
            line = (await self.process.stdout.readline()).decode()
        assert line.startswith("padwatch: token to create the first account"), line
        return line.rpartition(" ")[2].strip()

    async def get(self, path: str, **parameters: Any) -> Any:
        """Ask the API, again where it is too busy to answer; the answer must be 200."""
        async with (
            httpx2.AsyncClient(
                base_url=self.url, trust_env=False, timeout=PATIENCE_S, verify=TLS
            ) as client,
            asyncio.timeout(PATIENCE_S),
        ):
            response = await client.get(path, params=parameters)
            while response.status_code == 503 and "retry-after" in response.headers:
                await asyncio.sleep(0.5)
                response = await client.get(path, params=parameters)
        assert response.status_code == 200, response.text
        return response.json()

    async def until(
        self,
        path: str,
        condition: Callable[[Any], bool],
        patience_s: float = PATIENCE_S,
        **parameters: Any,
    ) -> Any:
        """Ask the API until its answer is as wanted."""
        answer = None
        try:
            async with asyncio.timeout(patience_s):
                while not condition(answer := await self.get(path, **parameters)):
                    await asyncio.sleep(0.2)
        except TimeoutError:
            raise AssertionError(f"{path} never came to be so; last: {answer}") from None
        return answer

    async def end(self, number: int = signal.SIGTERM) -> int:
        """Send a signal and wait for the end; what outlasts that is killed and fails the test."""
        if self.process.returncode is None:
            self.process.send_signal(number)
        try:
            async with asyncio.timeout(PATIENCE_S):
                return await self.process.wait()
        except TimeoutError:
            raise AssertionError(f"did not end on signal {number}: {self.errors}") from None
        finally:
            self.kill()
            await self.process.wait()
            # To the end of both pipes, else uvloop cannot close. A child that should not have
            # survived would hold them open.
            assert self.process.stdout is not None
            rest = asyncio.create_task(self.process.stdout.read())
            await asyncio.wait([self._reading, rest], timeout=5)
            self._reading.cancel()
            rest.cancel()

    def kill(self) -> None:
        """End it at once, if it has not ended."""
        if self.process.returncode is None:
            self.process.kill()

    async def _read_errors(self) -> None:
        assert self.process.stderr is not None
        while line := await self.process.stderr.readline():
            self.errors += line.decode()


Start = Callable[..., Awaitable[Program]]


@asynccontextmanager
async def programs(folder: Path) -> AsyncIterator[Start]:
    """Starts `padwatch` with arguments, in a folder; ends what is left running."""
    begun: list[Program] = []

    async def start(*arguments: str) -> Program:
        process = await asyncio.create_subprocess_exec(
            sys.executable,
            *("-m", "service.cli.main", *arguments),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"},
        )
        begun.append(Program(process))
        return begun[-1]

    yield start
    for program in begun:
        await program.end(signal.SIGTERM if program.process.returncode is None else 0)


@pytest.fixture
async def start(tmp_path: Path) -> AsyncIterator[Start]:
    """Starts `padwatch` with arguments, in an empty folder; ends what a test leaves running."""
    async with programs(tmp_path) as begin:
        yield begin


@pytest.fixture
def demo_file() -> Path:
    """The plant file that `padwatch demo` runs."""
    return DEMO


def write_demo(
    folder: Path,
    ports: Mapping[str, int] = ABSENT,
    *,
    source: str = WIRE,
    service: str = "",
    tables: str = "",
) -> Path:
    """Write a plant file: the demo's first unit once for each port, with its data beside it.

    Parameters
    ----------
    source
        Table of each unit's source, with a place for the port.
    service, tables
        More keys of the table [service], and more tables.
    """
    head, unit = DEMO.read_text(encoding="utf-8").split("[[unit]]\n")[:2]
    wire = WIRE.format(port=0)
    assert wire in unit
    head = head.replace("var/demo", str(folder / "data"))
    text = head.replace("[service]\n", f"[service]\n{service}") + tables + "\n"
    for name, port in ports.items():
        own = unit.replace('"U1"', f'"{name}"').replace(wire, source.format(port=port))
        text += f"[[unit]]\n{own}"
    path = folder / "plant.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def write_plant() -> Callable[..., Path]:
    """Writes plant files; see `write_demo`."""
    return write_demo


def child_of(is_serving: bool, pid: int) -> int:
    """Return the one child of a process that serves, or the one that does not."""
    found = []
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        with suppress(FileNotFoundError, ProcessLookupError):  # it has ended meanwhile
            line = Path(f"/proc/{child}/cmdline").read_text().replace("\0", " ")
            found += [int(child)] if (SERVING in line) == is_serving else []
    [only] = found
    return only


@pytest.fixture
def daq_of() -> Callable[[int], int]:
    """Process id of the simulated DAQ of a demo or replay, which is a child of it."""
    return partial(child_of, False)


@pytest.fixture
def serving_of() -> Callable[[int], int]:
    """Process id of the serving process of a measuring process, whose child it is."""
    return partial(child_of, True)


@pytest.fixture
def gone() -> Callable[[int], Awaitable[None]]:
    """Waits until a process has ended, reaped or not."""

    def is_running(pid: int) -> bool:
        try:
            stat = Path(f"/proc/{pid}/stat").read_text()
        except (FileNotFoundError, ProcessLookupError):
            return False
        return stat.rpartition(")")[2].split()[0] not in "ZX"

    async def wait(pid: int) -> None:
        try:
            async with asyncio.timeout(PATIENCE_S):
                while is_running(pid):
                    await asyncio.sleep(0.05)
        except TimeoutError:
            os.kill(pid, signal.SIGKILL)
            raise AssertionError(f"process {pid} is still running") from None

    return wait
