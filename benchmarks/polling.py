"""What fifty polling dashboards cost the service of a plant of twenty units.

Three processes: simulated DAQs (20 units, 12 channels, 600 Hz, Modbus TCP on loopback), the whole
service, and this one: fifty clients that each ask for the overview, the alarms and a bearing's
trends once a second, as the dashboard does: what they have got already they name by its ETag.
Prints a table; ends with 1 if a sample was lost or a limit was passed.
"""

import argparse
import asyncio
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import psutil
import uvloop
from ingest import daq, fetch, padwatch, plant_file

P99_LIMIT_MS = 50.0
CORE_LIMIT = 0.60
PERIOD_S = 1.0
TREND_MINUTES = 15
MAX_POINTS = 500
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
    n_same: int = 0
    n_failed: int = 0

    def percentile_ms(self, percent: float) -> float:
        ordered = sorted(self.seconds)
        return 1e3 * ordered[min(len(ordered) - 1, int(percent / 100 * len(ordered)))]


class Client:
    """One browser: one connection, the ETags of what it has got."""

    def __init__(self, address: tuple[str, int], answers: Mapping[str, Answers]) -> None:
        self._address, self._answers = address, answers
        self._etags: dict[str, str] = {}

    async def poll(self, paths: Mapping[str, Any], begin_s: float, end_s: float) -> None:
        """Ask for everything once a second until the end; answers before the begin do not count."""
        reader, writer = await asyncio.open_connection(*self._address)
        due = time.monotonic()
        while due < end_s:
            for kind, path in paths.items():
                asked = time.monotonic()
                status = await self._ask(reader, writer, kind, path())
                if asked >= begin_s:
                    self._count(kind, status, time.monotonic() - asked)
            due += PERIOD_S
            await asyncio.sleep(max(0.0, due - time.monotonic()))
        writer.close()

    async def _ask(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, kind: str, path: str
    ) -> int:
        known = f"If-None-Match: {self._etags[kind]}\r\n" if kind in self._etags else ""
        host, port = self._address
        writer.write(f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\n{known}\r\n".encode())
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
        status_line, *lines = head.split("\r\n")
        headers = {
            name.lower(): value.strip() for name, _, value in (x.partition(":") for x in lines)
        }
        await reader.readexactly(int(headers.get("content-length", 0)))
        if "etag" in headers:
            self._etags[kind] = headers["etag"]
        return int(status_line.split()[1])

    def _count(self, kind: str, status: int, spent_s: float) -> None:
        answers = self._answers[kind]
        answers.seconds.append(spent_s)
        answers.n_same += status == 304
        answers.n_failed += status not in (200, 304)


def trend_path(unit: str, bearing: str) -> str:
    """The question of a bearing's page: its last quarter of an hour."""
    now = datetime.now(UTC)
    times = {"start": now - timedelta(minutes=TREND_MINUTES), "end": now}
    query = "&".join(f"quantity={name}" for name in QUANTITIES)
    query += "".join(f"&{name}={time_:%Y-%m-%dT%H:%M:%SZ}" for name, time_ in times.items())
    return f"/api/v1/units/{unit}/bearings/{bearing}/trends?{query}&max_points={MAX_POINTS}"


async def poll_all(
    url: str, bearings: list[tuple[str, str]], n: int, options: Any
) -> dict[str, Answers]:
    """Let all clients ask; return what they measured."""
    parts = urlsplit(url)
    address = (str(parts.hostname), int(parts.port or 80))
    answers = {kind: Answers() for kind in ("overview", "alarms", "trends")}
    begin_s = time.monotonic() + 2 * PERIOD_S

    async def client(number: int) -> None:
        await asyncio.sleep(PERIOD_S * number / n)  # fifty browsers were not opened in one moment
        unit, bearing = bearings[number % len(bearings)]
        paths = {
            "overview": lambda: "/api/v1/overview",
            "alarms": lambda: "/api/v1/alarms",
            "trends": lambda: trend_path(unit, bearing),
        }
        await Client(address, answers).poll(paths, begin_s, begin_s + options.seconds)

    await asyncio.gather(*(client(number) for number in range(n)))
    return answers


def measure(plant: Path, options: Any) -> dict[str, Any]:
    """Run the service, first alone and then with all clients."""
    with padwatch("run", str(plant), "--port", "0") as (process, line):
        url = line.split()[-1]
        watched = psutil.Process(process.pid)
        time.sleep(options.warm_up)
        alone = cores(watched, lambda: time.sleep(options.alone))
        units = fetch(f"{url}api/v1/overview")["units"]
        bearings = [(unit["id"], b["bearing"]) for unit in units for b in unit["bearings"]]
        answers: dict[str, Answers] = {}
        polled = cores(
            watched,
            lambda: answers.update(uvloop.run(poll_all(url, bearings, options.clients, options))),
        )
        sources = [unit["source"] for unit in fetch(f"{url}api/v1/overview")["units"]]
        lost = sum(source["n_offered"] - source["n_stored"] for source in sources)
        offered = sum(source["n_offered"] for source in sources)
    return {"alone": alone, "polled": polled, "answers": answers, "lost": lost, "offered": offered}


def cores(watched: psutil.Process, do: Any) -> float:
    """Share of one core that a process takes while something is done."""
    before, started = watched.cpu_times(), time.monotonic()
    do()
    after, elapsed = watched.cpu_times(), time.monotonic() - started
    return float((after.user + after.system - before.user - before.system) / elapsed)


def report(found: dict[str, Any], options: Any) -> int:
    """Print the table; return the exit code."""
    print(
        f"{options.units} units over Modbus TCP, {options.clients} clients at {1 / PERIOD_S:g} Hz"
    )
    print(
        f"  {'answer':<12}{'asked':>9}{'304':>9}{'failed':>9}"
        f"{'p50 ms':>9}{'p99 ms':>9}{'max ms':>9}"
    )
    for kind, answers in found["answers"].items():
        times = "".join(f"{answers.percentile_ms(p):>9.1f}" for p in (50, 99, 100))
        n = len(answers.seconds)
        print(f"  {kind:<12}{n:>9,}{answers.n_same:>9,}{answers.n_failed:>9,}{times}")
    everything = Answers([s for answers in found["answers"].values() for s in answers.seconds])
    p99_ms = everything.percentile_ms(99)
    print(f"  p99 of all answers             {p99_ms:>8.1f} ms (at most {P99_LIMIT_MS:g})")
    print(
        f"  samples per channel lost       {found['lost']:>8,} of {found['offered']:,} (allowed 0)"
    )
    print(f"  service alone, one core        {found['alone']:>8.1%}")
    print(f"  service with its clients       {found['polled']:>8.1%}    (at most {CORE_LIMIT:.0%})")
    n_failed = sum(answers.n_failed for answers in found["answers"].values())
    return int(
        p99_ms > P99_LIMIT_MS or found["lost"] > 0 or found["polled"] > CORE_LIMIT or n_failed > 0
    )


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=20)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--warm-up", type=float, default=20.0)
    parser.add_argument("--alone", type=float, default=30.0)
    parser.add_argument("--seconds", type=float, default=120.0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        plant, data = Path(folder) / "plant.toml", Path(folder) / "data"
        plant.write_text(plant_file(options.units, data), encoding="utf-8")
        with daq(plant) as ports:
            plant.write_text(plant_file(options.units, data, ports), encoding="utf-8")
            found = measure(plant, options)
    sys.exit(report(found, options))


if __name__ == "__main__":
    main()
