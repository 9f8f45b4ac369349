"""From wire to stored assessment: what a plant of twenty units costs the service.

Simulated DAQs (20 units, 12 channels, 600 Hz, Modbus TCP on loopback), the service with its two
processes, and afterwards a bare pymodbus loop that reads as many registers from the same DAQs and
does nothing with them. Prints a table; ends with 1 if a sample was lost or a limit was passed.
With --delays, also how long after the last sample of a hop its results were known and stored; the
notes of these times cost the service some processor time.
"""

import argparse
import asyncio
import json
import subprocess
import sys
import tempfile
import time
import tomllib
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import psutil
import uvloop
from pymodbus.client import AsyncModbusTcpClient

from service.app.analysis import APART_S

DEMO = Path(__file__).parents[1] / "deploy" / "demo.toml"
CORE_LIMIT = 0.30
MEMORY_LIMIT_MIB = 420.0
WARM_UP_S = 20.0
MAX_TRIES = 30
SETTLE_S = 10.0
"""Time in which the simulators produce the samples of their own start."""

UNITS_PER_DAQ = 25
"""A simulated unit takes one percent of a core; an overloaded simulator no longer answers."""
REGISTERS_PER_READ = 125
MIB = 2**20
SEGMENT_SAMPLES, HOP_SAMPLES, RATE_HZ = 8192, 7168, 600.0


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--bare-seconds", type=float, default=60.0)
    parser.add_argument("--delays", action="store_true", help="print the delays of results")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        plant, data = Path(folder) / "plant.toml", Path(folder) / "data"
        with daqs(options.units, Path(folder)) as ports:
            plant.write_text(plant_file(options.units, data, ports), encoding="utf-8")
            log = Path(folder) / "delays" if options.delays else None
            service = measure_service(plant, options.seconds, log)
            code = report(options.units, service)
            sys.stdout.flush()
            bare = uvloop.run(bare_loop(list(ports.values()), options.bare_seconds))
    print(f"  bare pymodbus loop, one core  {bare['cores']:>12.1%}")
    print(f"  of so many reads a second     {bare['reads_per_s']:>12,.0f}")
    print(f"  service / bare loop           {sum(service['cores']) / bare['cores']:>12.2f}")
    sys.exit(code)


def plant_file(
    n_units: int, data_folder: Path, ports: dict[str, int] | None = None, first: int = 1
) -> str:
    """The demo plant's second unit, many times over, numbered from `first` on."""
    text = DEMO.read_text(encoding="utf-8")
    unit = text[text.rindex("[[unit]]") :]
    parts = [f'[plant]\nname = "Benchmark"\n\n[service]\ndata_folder = "{data_folder}"\n\n']
    for number in range(first, first + n_units):
        id_ = f"U{number}"
        port = 0 if ports is None else ports[id_]
        mine = unit.replace('id = "U2"', f'id = "{id_}"').replace("port = 0", f"port = {port}")
        parts.append(mine.replace("seed = 2", f"seed = {number}") + "\n")
    tomllib.loads("".join(parts))
    return "".join(parts)


@contextmanager
def padwatch(*arguments: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the command; yield the process and the first line that it prints."""
    process = subprocess.Popen(
        [sys.executable, "-m", "service.cli.main", *arguments], stdout=subprocess.PIPE, text=True
    )
    try:
        yield process, process.stdout.readline() if process.stdout else ""
    finally:
        process.terminate()
        process.wait(60)


@contextmanager
def daq(plant: Path) -> Iterator[dict[str, int]]:
    with padwatch("daq", str(plant)) as (_, line):
        yield {unit: int(found["port"]) for unit, found in json.loads(line).items()}


@contextmanager
def daqs(n_units: int, folder: Path) -> Iterator[dict[str, int]]:
    """Run the DAQs of a plant in as many processes as they need; yield their ports by unit."""
    ports: dict[str, int] = {}
    with ExitStack() as running:
        for first in range(1, n_units + 1, UNITS_PER_DAQ):
            plant, n_own = folder / f"daq{first}.toml", min(UNITS_PER_DAQ, n_units + 1 - first)
            plant.write_text(plant_file(n_own, folder / "data", first=first), encoding="utf-8")
            ports |= running.enter_context(daq(plant))
        time.sleep(SETTLE_S)
        yield ports


def processes(pid: int) -> list[psutil.Process]:
    """Return the measuring process of a service, and its serving process."""
    measuring = psutil.Process(pid)
    return [measuring, *measuring.children()]


def cpu_s(watched: psutil.Process) -> float:
    """Return the CPU time of a process so far, s."""
    times = watched.cpu_times()
    return float(times.user + times.system)


@contextmanager
def service_of(plant: Path, log: Path | None) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the service, with a log of the delays if given; yield the process and its URL."""
    if log is None:
        with padwatch("run", str(plant), "--port", "0") as (process, line):
            yield process, line.split()[-1]
    else:
        from storms import service

        with service(plant, log) as found:
            yield found


def delays_s(log: Path | None, since_ns: int) -> dict[str, list[float]]:
    """Return the delays of results and of their storing after the last sample, in seconds."""
    found: dict[str, list[float]] = {"result": [], "stored": []}
    for kind, at_ns, delay_ns in map(str.split, log.read_text().splitlines() if log else ()):
        if kind in found and int(at_ns) >= since_ns:
            found[kind].append(int(delay_ns) / 1e9)
    return found


def measure_service(plant: Path, duration_s: float, log: Path | None = None) -> dict[str, Any]:
    """Let the service run and measure its processes from after its start."""
    with service_of(plant, log) as (process, url):
        watched = processes(process.pid)
        time.sleep(WARM_UP_S)
        before, started = [cpu_s(each) for each in watched], time.monotonic()
        since_ns = time.time_ns()
        peak = [0, 0]
        while time.monotonic() - started < duration_s:
            time.sleep(1.0)
            peak = max(peak, [each.memory_info().rss for each in watched], key=sum)
        after, elapsed = [cpu_s(each) for each in watched], time.monotonic() - started
        units = fetch(f"{url}api/v1/units")
        n_results = sum(n_stored_results(url, unit) for unit in units)
    sources = [unit["source"] for unit in units]
    return {
        "cores": [(end - begin) / elapsed for begin, end in zip(before, after, strict=True)],
        "peak_mib": [each / MIB for each in peak],
        "n_offered": sum(source["n_offered"] for source in sources),
        "n_stored": sum(source["n_stored"] for source in sources),
        "n_results": n_results,
        "n_expected": sum(n_due_results(unit) for unit in units),
        "elapsed_s": elapsed,
        "delays_s": delays_s(log, since_ns),
    }


def fetch(url: str, cookie: str = "") -> Any:
    request = urllib.request.Request(url, headers={"Cookie": cookie})  # noqa: S310  our service
    for n_left in reversed(range(MAX_TRIES)):
        try:
            with urllib.request.urlopen(request) as answer:  # noqa: S310
                return json.load(answer)
        except urllib.error.HTTPError as error:
            if error.code != 503 or not n_left:
                raise
        time.sleep(1.0)  # the service is busy
    raise AssertionError


def n_stored_results(url: str, unit: dict[str, Any]) -> int:
    """Results of a unit that the service reads back from its disk."""
    query = "quantity=speed_rpm&start=2020-01-01T00:00:00Z&end=2100-01-01T00:00:00Z&max_points=5000"
    return sum(
        sum(
            fetch(f"{url}api/v1/units/{unit['id']}/bearings/{bearing}/trends?{query}")["series"][
                "speed_rpm"
            ]["count"]
        )
        for bearing in unit["bearing_ids"]
    )


def n_due_results(unit: dict[str, Any]) -> int:
    """Results that the samples of a unit allow, all bearings together."""
    n_held = round((int(unit["id"][1:]) - 1) * APART_S * RATE_HZ) % HOP_SAMPLES
    n_segments = (unit["source"]["n_stored"] - n_held - SEGMENT_SAMPLES) // HOP_SAMPLES + 1
    return n_segments * len(unit["bearing_ids"])


async def bare_loop(ports: list[int], duration_s: float) -> dict[str, float]:
    """Read as many registers a second with nothing but pymodbus, one connection a device."""
    n_reads = 0
    # 12 channels at 600 Hz, 50 samples a slot: 12 slots a second of 611 registers, 5 reads each,
    # and one read of the header, as the service does
    reads_per_s, period_s = 12 * 5 + 1, 1.0
    process = psutil.Process()
    started, before = time.monotonic(), process.cpu_times()

    async def read(port: int) -> None:
        nonlocal n_reads
        client = AsyncModbusTcpClient("127.0.0.1", port=port, retries=0, timeout=30.0)
        await client.connect()
        due = time.monotonic()
        while due - started < duration_s:
            for _ in range(round(reads_per_s * period_s)):
                await client.read_holding_registers(0, count=REGISTERS_PER_READ, device_id=1)
                n_reads += 1
            due += period_s
            await asyncio.sleep(max(0.0, due - time.monotonic()))
        client.close()

    await asyncio.gather(*(read(port) for port in ports))
    after, elapsed = process.cpu_times(), time.monotonic() - started
    used = after.user + after.system - before.user - before.system
    return {"cores": used / elapsed, "reads_per_s": n_reads / elapsed}


def report(n_units: int, service: dict[str, Any]) -> int:
    """Print the table of the service; return the exit code."""
    lost = service["n_offered"] - service["n_stored"]
    print(f"{n_units} units x 12 channels x 600 Hz over Modbus TCP, {service['elapsed_s']:.0f} s")
    print(f"  samples per channel offered   {service['n_offered']:>12,}")
    print(f"  of these not stored           {lost:>12,}   (allowed 0)")
    print(
        f"  results on the disk, of due   {service['n_results']:>12,}   ({service['n_expected']:,})"
    )
    cores, mib = sum(service["cores"]), sum(service["peak_mib"])
    for name, share, peak in zip(
        ("measuring", "serving"), service["cores"], service["peak_mib"], strict=True
    ):
        print(f"  {name:<9} process, one core   {share:>12.1%}; memory {peak:.0f} MiB")
    print(f"  both, share of one core       {cores:>12.1%}   (at most {CORE_LIMIT:.0%})")
    print(f"  both, peak memory             {mib:>8.0f} MiB   (at most {MEMORY_LIMIT_MIB:.0f} MiB)")
    for kind, found in service["delays_s"].items():
        if found:
            p99, most = sorted(found)[int(0.99 * len(found))], max(found)
            print(
                f"  {kind:<8} after the hop, p99 {p99:>11.2f} s  (most {most:.2f} s; 2 s required)"
            )
    failed = (
        lost > 0
        or service["n_results"] < service["n_expected"]
        or cores > CORE_LIMIT
        or mib > MEMORY_LIMIT_MIB
    )
    return int(failed)


if __name__ == "__main__":
    main()
