"""What fifty polling dashboards cost the service of a plant of twenty units.

Simulated DAQs (20 units, 12 channels, 600 Hz, Modbus TCP on loopback), the service with its two
processes, and this one: fifty clients that each ask for the overview, the alarms, a bearing and its
trends once a second, as the dashboard does: what they have got already they name by its ETag, and
of the overview they ask for the units that changed. ``--postgres`` repeats this with results in
PostgreSQL and a login of each client, and needs the tests' harness on PYTHONPATH (``make bench``).
Prints a table; ends with 1 if a sample was lost or a limit was passed.
"""

import argparse
import asyncio
import json
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from statistics import median
from typing import Any
from urllib.parse import urlsplit

import psutil
import pyarrow as pa
import uvloop
from ingest import cpu_s, daq, fetch, padwatch, plant_file, processes

P99_LIMIT_MS = 15.0
CORE_LIMIT = 0.08
PERIOD_S = 1.0
USERS = (sys.executable, "-m", "service.cli.main", "users", "add")
TREND_MINUTES = 15
MAX_POINTS = 500
SESSIONS = 16
"""Of an account, at the most."""

PASSWORD = "polls once a second"  # noqa: S105  of the benchmark alone
QUANTITIES = (
    "stiffness_xx_n_per_m",
    "stiffness_yy_n_per_m",
    "order1_shaft_x_um_pk",
    "order1_shaft_y_um_pk",
    "order1_bearing_x_um_pk",
    "order1_bearing_y_um_pk",
)


@dataclass
class Answers:
    """How long the answers of one kind took, and how many said that nothing is new."""

    seconds: list[float] = field(default_factory=list)
    n_bytes: list[int] = field(default_factory=list)
    n_same: int = 0
    n_failed: int = 0

    def percentile_ms(self, percent: float) -> float:
        ordered = sorted(self.seconds)
        return 1e3 * ordered[min(len(ordered) - 1, int(percent / 100 * len(ordered)))]


class Client:
    """One browser: one connection, the ETags of what it has got."""

    def __init__(
        self, address: tuple[str, int], answers: Mapping[str, Answers], cookie: str
    ) -> None:
        self._address, self._answers, self._cookie = address, answers, cookie
        self._etags: dict[str, str] = {}
        self.revision: str | None = None

    async def poll(self, paths: Mapping[str, Any], begin_s: float, end_s: float) -> None:
        """Ask for everything once a second until the end; answers before the begin do not count."""
        reader, writer = await asyncio.open_connection(*self._address)
        due = time.monotonic()
        while due < end_s:
            for kind, path in paths.items():
                asked = time.monotonic()
                status, n_bytes = await self._ask(reader, writer, kind, path())
                if asked >= begin_s:
                    self._count(kind, status, n_bytes, time.monotonic() - asked)
            due += PERIOD_S
            await asyncio.sleep(max(0.0, due - time.monotonic()))
        writer.close()

    async def _ask(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, kind: str, path: str
    ) -> tuple[int, int]:
        if kind == "overview" and self.revision is not None:
            path += f"?since={self.revision}"
        known = f"If-None-Match: {self._etags[path]}\r\n" if path in self._etags else ""
        known += "Accept-Encoding: gzip, deflate, br, zstd\r\n"
        known += f"Cookie: {self._cookie}\r\n" if self._cookie else ""
        host, port = self._address
        writer.write(f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\n{known}\r\n".encode())
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
        status_line, *lines = head.split("\r\n")
        headers = {
            name.lower(): value.strip() for name, _, value in (x.partition(":") for x in lines)
        }
        body = await reader.readexactly(int(headers.get("content-length", 0)))
        if "etag" in headers:
            self._etags[path] = headers["etag"]
        if kind == "overview" and body:
            is_encoded = headers.get("content-encoding") == "zstd"
            self.revision = json.loads(unpacked(body) if is_encoded else body)["revision"]
        return int(status_line.split()[1]), len(head) + len(body)

    def _count(self, kind: str, status: int, n_bytes: int, spent_s: float) -> None:
        answers = self._answers[kind]
        answers.seconds.append(spent_s)
        answers.n_bytes.append(n_bytes)
        answers.n_same += status == 304
        answers.n_failed += status not in (200, 304)


def unpacked(body: bytes) -> bytes:
    """A body that was compressed by zstd."""
    with pa.input_stream(pa.BufferReader(body), compression="zstd") as stream:
        return bytes(stream.read())


def trend_path(unit: str, bearing: str) -> str:
    """The question of a bearing's page: its last quarter of an hour, up to a whole minute."""
    now = datetime.now(UTC).replace(second=0, microsecond=0) + timedelta(minutes=1)
    times = {"start": now - timedelta(minutes=TREND_MINUTES), "end": now}
    query = "&".join(f"quantity={name}" for name in QUANTITIES)
    query += "".join(f"&{name}={time_:%Y-%m-%dT%H:%M:%SZ}" for name, time_ in times.items())
    return f"/api/v1/units/{unit}/bearings/{bearing}/trends?{query}&max_points={MAX_POINTS}"


def log_in(url: str, name: str) -> str:
    """Log in; return the cookie of the session."""
    body = json.dumps({"name": name, "password": PASSWORD}).encode()
    headers = {"Content-Type": "application/json", "Origin": url.rstrip("/")}
    request = urllib.request.Request(f"{url}api/v1/session", body, headers)  # noqa: S310
    with urllib.request.urlopen(request) as answer:  # noqa: S310  our own service
        return str(answer.headers["Set-Cookie"]).partition(";")[0]


async def poll_all(
    url: str, bearings: list[tuple[str, str]], cookies: Sequence[str], options: Any
) -> dict[str, Answers]:
    """Let all clients ask; return what they measured."""
    parts = urlsplit(url)
    address = (str(parts.hostname), int(parts.port or 80))
    answers = {kind: Answers() for kind in ("overview", "alarms", "bearing", "trends")}
    begin_s = time.monotonic() + 2 * PERIOD_S

    async def client(number: int) -> None:
        # fifty browsers were not opened in one moment
        await asyncio.sleep(PERIOD_S * number / len(cookies))
        unit, bearing = bearings[number % len(bearings)]
        paths = {
            "overview": lambda: "/api/v1/overview",
            "alarms": lambda: "/api/v1/alarms",
            "bearing": lambda: f"/api/v1/units/{unit}/bearings/{bearing}/latest",
            "trends": lambda: trend_path(unit, bearing),
        }
        polling = Client(address, answers, cookies[number])
        await polling.poll(paths, begin_s, begin_s + options.seconds)

    await asyncio.gather(*(client(number) for number in range(len(cookies))))
    return answers


def measure(plant: Path, options: Any, *, log_in_each: bool) -> dict[str, Any]:
    """Run the service, first alone and then with all clients."""
    with padwatch("run", str(plant), "--port", "0") as (process, line):
        url = line.split()[-1]
        watched = processes(process.pid)
        time.sleep(options.warm_up)
        alone = cores(watched, lambda: time.sleep(options.alone))
        names = [f"operator{n // SESSIONS}" for n in range(options.clients)]
        cookies = [log_in(url, name) if log_in_each else "" for name in names]
        units = fetch(f"{url}api/v1/units", cookies[0])
        bearings = [(unit["id"], bearing) for unit in units for bearing in unit["bearing_ids"]]
        first = first_overview(url, cookies[0])
        answers: dict[str, Answers] = {}
        polled = cores(
            watched,
            lambda: answers.update(uvloop.run(poll_all(url, bearings, cookies, options))),
        )
        sources = [unit["source"] for unit in fetch(f"{url}api/v1/units", cookies[0])]
        lost = sum(source["n_offered"] - source["n_stored"] for source in sources)
        offered = sum(source["n_offered"] for source in sources)
    found = {"alone": alone, "polled": polled, "answers": answers, "first": first}
    return {**found, "lost": lost, "offered": offered}


def first_overview(url: str, cookie: str) -> int:
    """Bytes of the body of the whole overview on the wire."""
    request = urllib.request.Request(  # noqa: S310  our own service
        f"{url}api/v1/overview", headers={"Accept-Encoding": "zstd", "Cookie": cookie}
    )
    with urllib.request.urlopen(request) as answer:  # noqa: S310
        return len(answer.read())


def cores(watched: Sequence[psutil.Process], do: Any) -> list[float]:
    """Share of one core that each process takes while something is done."""
    before, started = [cpu_s(each) for each in watched], time.monotonic()
    do()
    elapsed = time.monotonic() - started
    return [(cpu_s(each) - begin) / elapsed for begin, each in zip(before, watched, strict=True)]


@contextmanager
def database() -> Iterator[str]:
    """Start a PostgreSQL server of its own; yield the address of an empty database."""
    from harness.postgres_server import PostgresServer

    with PostgresServer() as server:
        yield server.create("padwatch")


def report(found: dict[str, Any], options: Any) -> int:
    """Print the table; return the exit code."""
    print(
        f"{options.units} units over Modbus TCP, {options.clients} clients at {1 / PERIOD_S:g} Hz"
    )
    print(
        f"  {'answer':<12}{'asked':>9}{'304':>9}{'failed':>9}"
        f"{'p50 ms':>9}{'p99 ms':>9}{'max ms':>9}{'p50 kB':>9}"
    )
    for kind, answers in found["answers"].items():
        times = "".join(f"{answers.percentile_ms(p):>9.1f}" for p in (50, 99, 100))
        n = len(answers.seconds)
        kb = median(answers.n_bytes) / 1e3
        print(f"  {kind:<12}{n:>9,}{answers.n_same:>9,}{answers.n_failed:>9,}{times}{kb:>9.2f}")
    print(f"  first overview on the wire     {found['first'] / 1e3:>8.1f} kB")
    everything = Answers([s for answers in found["answers"].values() for s in answers.seconds])
    p99_ms = everything.percentile_ms(99)
    print(f"  p99 of all answers             {p99_ms:>8.1f} ms (at most {P99_LIMIT_MS:g})")
    print(
        f"  samples per channel lost       {found['lost']:>8,} of {found['offered']:,} (allowed 0)"
    )
    for name, alone, polled in zip(
        ("measuring", "serving"), found["alone"], found["polled"], strict=True
    ):
        print(f"  {name:<9} of one core          {alone:>8.1%} alone, {polled:.1%} with clients")
    print(f"  serving with clients, at most  {CORE_LIMIT:>8.0%}")
    serving = found["polled"][1]
    n_failed = sum(answers.n_failed for answers in found["answers"].values())
    return int(p99_ms > P99_LIMIT_MS or found["lost"] > 0 or serving > CORE_LIMIT or n_failed > 0)


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=20)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--warm-up", type=float, default=20.0)
    parser.add_argument("--alone", type=float, default=30.0)
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--postgres", action="store_true", help="then PostgreSQL and logins, too")
    options = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        plant, data = Path(folder) / "plant.toml", Path(folder) / "data"
        plant.write_text(plant_file(options.units, data), encoding="utf-8")
        with daq(plant) as ports:
            plant.write_text(plant_file(options.units, data, ports), encoding="utf-8")
            failed |= report(measure(plant, options, log_in_each=False), options)
            if options.postgres:
                with database() as conninfo:
                    text = plant_file(options.units, data, ports)
                    text += f'[store]\npostgresql = "{conninfo}"\n[access]\nlogin = true\n'
                    plant.write_text(text, encoding="utf-8")
                    for n in range(-(-options.clients // SESSIONS)):
                        command = [*USERS, str(plant), f"operator{n}", "--password-fd", "0"]
                        subprocess.run(command, input=PASSWORD.encode(), check=True)
                    print("PostgreSQL, each client with a session of its own:")
                    failed |= report(measure(plant, options, log_in_each=True), options)
    sys.exit(failed)


if __name__ == "__main__":
    main()
