"""What attacks on the port cost the measuring process: samples lost, and results that come late.

Simulated DAQs (12 channels, 600 Hz, Modbus TCP on loopback), `padwatch run` on all of them, and
clients in a process of their own that flood it, one storm after the other, with rest before each:

- login: 60 connections post 61 kB of unknown members to the login, without a pause,
- members: the same with 16 kB, which are not refused by their length,
- document: 60 connections ask for the OpenAPI document, without a pause,
- polling: 200 clients ask for overview, alarms and trends five times a second,
- browsers: 20 browsers with an empty cache open the dashboard at once, again and again,
- half-open: 500 clients begin a request and never finish it,
- kills: kill -9 of the serving process as soon as it answers.

Delays are those between the sampling of the newest sample and the end of its judgement for alarms
(block), the end of its result (result) and the end of the commit (stored). Prints a table; ends
with 1 if a sample was lost or a storm did not reach the service.
"""

import argparse
import asyncio
import json
import os
import re
import runpy
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any
from urllib.parse import urlsplit

import numpy as np
import psutil
import uvloop
from ingest import cpu_s, daq, fetch, plant_file, processes

from core.alarms.unit_alarms import UnitAlarms
from core.monitor.assessment import Assessment
from service.measuring.recorder import Recorder
from service.store.store import Store

SETTLE_S = 20.0
POLLS_PER_S = 5.0


def unknown(number: int) -> bytes:
    """Return a body with so many members that no route has, 12 bytes each."""
    return json.dumps({f"m{each:04}": 1 for each in range(number)}).encode()


Request = bytes
Storm = Callable[[tuple[str, int], float, Counter[str]], Awaitable[None]]
"""Floods an address until a monotonic time; counts answers by status."""


def request(path: str, body: bytes | None = None) -> Request:
    """Return an HTTP request as bytes."""
    if body is None:
        return f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()
    length = f"Content-Type: application/json\r\nContent-Length: {len(body)}\r\n"
    return f"POST {path} HTTP/1.1\r\nHost: localhost\r\n{length}\r\n".encode() + body


async def ask(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, question: Request
) -> tuple[str, bytes]:
    """Send a request, read the whole answer, and return its status and body."""
    writer.write(question)
    head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").lower()
    length = head.partition("content-length:")[2].partition("\r\n")[0].strip()
    return head.split()[1], await reader.readexactly(int(length or 0))


async def client(
    at: tuple[str, int],
    questions: Sequence[Request],
    period_s: float,
    until_s: float,
    answers: Counter[str],
) -> None:
    """Ask one question after the other on one connection; connect again when it is closed."""
    while time.monotonic() < until_s:
        with suppress(OSError, asyncio.IncompleteReadError, TimeoutError):
            reader, writer = await asyncio.open_connection(*at)
            try:
                due_s = time.monotonic()
                while (now_s := time.monotonic()) < until_s:
                    for question in questions:
                        async with asyncio.timeout_at(
                            asyncio.get_running_loop().time() + until_s - now_s + 1.0
                        ):
                            answers[(await ask(reader, writer, question))[0]] += 1
                    due_s = max(due_s + period_s, time.monotonic())
                    await asyncio.sleep(max(0.0, min(due_s, until_s) - time.monotonic()))
            finally:
                writer.close()
        await asyncio.sleep(0.01)


def flood(n: int, questions: Sequence[Request], period_s: float = 0.0) -> Storm:
    """Return a storm of clients that all ask the same."""

    async def run(at: tuple[str, int], until_s: float, answers: Counter[str]) -> None:
        asking = (client(at, questions, period_s, until_s, answers) for _ in range(n))
        await asyncio.gather(*asking)

    return run


def browsers(n: int) -> Storm:
    """Return a storm of browsers without a cache; what a page needs comes on six connections."""

    async def load(at: tuple[str, int], paths: Sequence[str], answers: Counter[str]) -> bytes:
        reader, writer = await asyncio.open_connection(*at)
        body = b""
        for path in paths:
            status, body = await ask(reader, writer, request(path))
            answers[status] += 1
        writer.close()
        return body

    async def one(at: tuple[str, int], until_s: float, answers: Counter[str]) -> None:
        while time.monotonic() < until_s:
            try:
                page = (await load(at, ["/"], answers)).decode()
                paths = re.findall(r'(?:href|src)="(/[^"#]+)"', page)
                six = (load(at, paths[first::6], answers) for first in range(6))
                await asyncio.gather(*six)
            except (OSError, asyncio.IncompleteReadError):
                answers["not loaded"] += 1

    async def run(at: tuple[str, int], until_s: float, answers: Counter[str]) -> None:
        await asyncio.gather(*(one(at, until_s, answers) for _ in range(n)))

    return run


def half_open(n: int) -> Storm:
    """Return a storm of clients that begin a request, and come again when they are closed."""

    async def one(at: tuple[str, int], until_s: float, answers: Counter[str]) -> None:
        while time.monotonic() < until_s:
            with suppress(OSError, TimeoutError):
                reader, writer = await asyncio.open_connection(*at)
                writer.write(b"GET / HTTP/1.1\r\nHost: loc")
                answers["begun"] += 1
                async with asyncio.timeout(max(0.0, until_s - time.monotonic())):
                    await reader.read()
                writer.close()
            await asyncio.sleep(0.1)

    async def run(at: tuple[str, int], until_s: float, answers: Counter[str]) -> None:
        await asyncio.gather(*(one(at, until_s, answers) for _ in range(n)))

    return run


POLLED = [
    request("/api/v1/overview"),
    request("/api/v1/alarms"),
    request("/api/v1/units/U1/bearings/UJB/latest"),
]
STORMS = {
    "login": flood(60, [request("/api/v1/session", unknown(5100))]),
    "members": flood(60, [request("/api/v1/session", unknown(1300))]),
    "document": flood(60, [request("/api/v1/openapi.json")]),
    "polling": flood(200, POLLED, 1.0 / POLLS_PER_S),
    "browsers": browsers(20),
    "half-open": half_open(500),
}
KILLS = "kills"


async def attack(name: str, url: str, seconds: float) -> Counter[str]:
    """Run a storm; return the number of answers by status."""
    parts, answers = urlsplit(url), Counter[str]()
    at = (str(parts.hostname), int(parts.port or 80))
    await STORMS[name](at, time.monotonic() + seconds, answers)
    return answers


def kill_serving(pid: int, url: str, seconds: float) -> Counter[str]:
    """Kill the serving process as soon as it answers; return how often, and the longest outage."""
    answers, until_s, longest_s = Counter[str](), time.monotonic() + seconds, 0.0
    while time.monotonic() < until_s:
        for serving in psutil.Process(pid).children():
            serving.kill()
        killed_s = time.monotonic()
        while True:
            with suppress(OSError):
                fetch(f"{url}api/v1/overview")
                break
            time.sleep(0.02)
        longest_s = max(longest_s, time.monotonic() - killed_s)
        answers["killed"] += 1
    answers["longest outage, ms"] = round(1e3 * longest_s)
    return answers


def launch(log: str, arguments: Sequence[str]) -> None:
    """Run the command with delays written to a file, one for each line: kind, time and delay."""
    file: IO[str] = Path(log).open("a", encoding="ascii", buffering=1)  # noqa: SIM115

    def note(kind: str, sampled_ns: int) -> None:
        now_ns = time.time_ns()
        file.write(f"{kind} {now_ns} {now_ns - sampled_ns}\n")

    take, put, append = UnitAlarms.take, Recorder.put, Store.append

    def noted_take(self: Any, block: Any, *others: Any, **more: Any) -> Any:
        found = take(self, block, *others, **more)
        note("block", block.stop_ns)
        return found

    def noted_put(self: Any, findings: Any) -> None:
        put(self, findings)
        for each in findings:
            if isinstance(each, Assessment):
                note("result", each.time_ns)

    def noted_append(self: Any, assessments: Any, *others: Any, **more: Any) -> None:
        append(self, assessments, *others, **more)
        for each in assessments:
            note("stored", each.time_ns)

    UnitAlarms.take, Recorder.put, Store.append = noted_take, noted_put, noted_append  # type: ignore[assignment,method-assign]
    sys.argv = ["padwatch", *arguments]
    runpy.run_module("service.cli.main", run_name="__main__")


@contextmanager
def service(plant: Path, log: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the service on a plant file, with delays in a log; yield its process and URL."""
    command = [sys.executable, __file__, "--launch", str(log), "run", str(plant), "--port", "0"]
    # the attack fills no terminal: what is refused is logged
    with log.with_suffix(".errors").open("w") as errors:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True)
    try:
        yield process, (process.stdout.readline() if process.stdout else "").split()[-1]
    finally:
        process.terminate()
        process.wait(30)


@dataclass(frozen=True)
class Phase:
    """Time without or with a storm, and what was counted at its end.

    Parameters
    ----------
    n_lost
        Samples per channel that were offered during it and not stored, all units together.
    cores
        Shares of a core that measuring and serving took; the latter 0 if it was killed.
    """

    name: str
    begin_ns: int
    end_ns: int
    answers: Counter[str]
    n_lost: int
    cores: tuple[float, float]


def n_lost(url: str) -> int:
    """Number of samples that were offered and not stored, per channel, all units together."""
    sources = [unit["source"] for unit in fetch(f"{url}api/v1/units")]
    return sum(int(source["n_offered"]) - int(source["n_stored"]) for source in sources)


def spent_s(pid: int) -> dict[int, float]:
    """CPU time of measuring and serving, s, by process id, in this order."""
    return {each.pid: cpu_s(each) for each in processes(pid)}


def measure(plant: Path, log: Path, storms: Sequence[str], options: Any) -> list[Phase]:
    """Run the service; rest before each storm."""
    phases = []
    with service(plant, log) as (process, url):
        time.sleep(options.settle)

        def phase(name: str, do: Callable[[], Counter[str]]) -> None:
            lost, begin_ns, before = n_lost(url), time.time_ns(), spent_s(process.pid)
            answers = do()
            end_ns, after = time.time_ns(), spent_s(process.pid)
            time.sleep(options.rest / 4.0)  # samples that are late or lost are seen as such
            spent = [
                1e9 * (after[p] - s) / (end_ns - begin_ns) for p, s in before.items() if p in after
            ]
            cores = (spent[0], sum(spent[1:]))
            phases.append(Phase(name, begin_ns, end_ns, answers, n_lost(url) - lost, cores))

        for name in storms:
            phase("rest", lambda: time.sleep(options.rest) or Counter())
            if name == KILLS:
                phase(name, lambda: kill_serving(process.pid, url, options.seconds))
                continue
            command = [sys.executable, __file__, "--attack", name, url, str(options.seconds)]

            def storm(command: Sequence[str] = command) -> Counter[str]:
                done = subprocess.run(command, stdout=subprocess.PIPE, check=True)
                return Counter(json.loads(done.stdout))

            phase(name, storm)
    return phases


def delays_ms(log: Path, phase: Phase) -> dict[str, np.ndarray]:
    """Delays of a phase by kind, ms."""
    found: dict[str, list[float]] = {"block": [], "result": [], "stored": []}
    for line in log.read_text(encoding="ascii").splitlines():
        kind, at_ns, delay_ns = line.split()
        if phase.begin_ns <= int(at_ns) <= phase.end_ns:
            found[kind].append(int(delay_ns) / 1e6)
    return {kind: np.array(delays or [np.nan]) for kind, delays in found.items()}


def report(log: Path, phases: Sequence[Phase], options: Any) -> int:
    """Print the table; return the exit code."""
    where = f"{options.units} units over Modbus TCP, {os.cpu_count()} cores"
    print(f"{where}; each storm {options.seconds:g} s")
    heads = ("block p99", "max", "result p99", "max", "stored p99", "max", "cores m", "s", "lost")
    print(f"  {'delay in ms':<12}" + "".join(f"{head:>11}" for head in heads) + "  answers")
    for phase in phases:
        delays = delays_ms(log, phase)
        row = "".join(
            f"{np.percentile(delays[kind], percent):>11.0f}"
            for kind in ("block", "result", "stored")
            for percent in (99, 100)
        )
        row += "".join(f"{share:>11.2f}" for share in phase.cores) + f"{phase.n_lost:>11}"
        answers = ", ".join(f"{number} {status}" for status, number in phase.answers.most_common(4))
        print(f"  {phase.name:<12}{row}  {answers}")
    lost = sum(phase.n_lost for phase in phases)
    print(f"samples per channel lost: {lost}, allowed 0")
    missed = [phase.name for phase in phases if phase.name != "rest" and not phase.answers]
    if missed:
        print(f"storms that did not reach the service: {missed}")
    return int(lost > 0 or bool(missed))


def main() -> None:
    """Run the benchmark and print its table."""
    if sys.argv[1:2] == ["--launch"]:
        launch(sys.argv[2], sys.argv[3:])
        return
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=15.0, help="of each storm")
    parser.add_argument("--rest", type=float, default=15.0, help="seconds before each storm")
    parser.add_argument("--settle", type=float, default=SETTLE_S, help="seconds after the start")
    parser.add_argument("--storm", action="append", choices=[*STORMS, KILLS], help="only this one")
    parser.add_argument(
        "--attack", nargs=3, metavar=("STORM", "URL", "SECONDS"), help="only attack"
    )
    options = parser.parse_args()
    if options.attack is not None:
        name, url, seconds = options.attack
        print(json.dumps(uvloop.run(attack(name, url, float(seconds)))))
        return
    with tempfile.TemporaryDirectory() as folder:
        plant, log = Path(folder) / "plant.toml", Path(folder) / "delays.txt"
        plant.write_text(plant_file(options.units, Path(folder) / "data"), encoding="utf-8")
        with daq(plant) as ports:
            text = plant_file(options.units, Path(folder) / "data", ports)
            plant.write_text(text, encoding="utf-8")
            phases = measure(plant, log, options.storm or [*STORMS, KILLS], options)
        sys.exit(report(log, phases, options))


if __name__ == "__main__":
    main()
