"""A good client beside 500 that never finish a request, over a real service on loopback.

A third of the slow ones drips its headers, a third its body, a third says nothing. Required: the
good client's p99 at most doubles, every slow one is closed within 10 s, and the service ends within
5 s of SIGTERM while clients of every kind hang on to it.
"""

import argparse
import asyncio
import re
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

import httpx2

DEMO = Path(__file__).parents[1] / "deploy" / "demo.toml"
PATH = "/api/v1/overview"
DRIP_S = 1.0
MAX_RATIO, MAX_OPEN_S, MAX_STOP_S = 2.0, 10.0, 5.0

HANGING = (
    b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ",
    b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 60000\r\n\r\n[",
    b"GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET /static/plotly.min.js HTTP/1.1\r\nHost: localhost\r\n\r\n" * 8,
    b"GET /api/v1/units/U1/bearings/UJB/film/readings?format=csv HTTP/1.1\r\n"
    b"Host: localhost\r\n\r\n",
)
"""Of a head, of a body, idle after an answer, not reading megabytes, not reading tables."""

BEGINNINGS = (
    b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ",
    b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 60000\r\n\r\n",
    b"",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slow", type=int, default=500)
    parser.add_argument("--requests", type=int, default=1000)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--against", metavar="URL", help="only be slow, until the input ends")
    options = parser.parse_args()
    if options.against is not None:
        sys.exit(asyncio.run(be_slow(options.against, options.slow)))
    sys.exit(asyncio.run(measure(options.slow, options.requests, options.runs)))


async def measure(n_slow: int, n_requests: int, n_runs: int) -> int:
    with tempfile.TemporaryDirectory() as folder:
        process, url = await started(Path(folder))
        try:
            ratios, longest_s = [], 0.0
            print(f"{'run':>4}{'alone p99 ms':>14}{'beside p99 ms':>15}{'ratio':>8}{'open s':>8}")
            for run in range(n_runs):
                alone_ms = await p99_ms(url, n_requests)
                beside_ms, open_s = await beside(url, n_slow, n_requests)
                ratios.append(beside_ms / alone_ms)
                longest_s = max(longest_s, open_s)
                found = f"{run + 1:>4}{alone_ms:>14.2f}{beside_ms:>15.2f}"
                print(f"{found}{ratios[-1]:>8.2f}{open_s:>8.2f}", flush=True)
            stop_s = await ended_among_hanging(process, url, n_slow)
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    middle = sorted(ratios)[len(ratios) // 2]
    print(f"median ratio {middle:.2f}, at most {MAX_RATIO}")
    print(f"longest open {longest_s:.2f} s, at most {MAX_OPEN_S}")
    print(f"ended {stop_s:.2f} s after SIGTERM, at most {MAX_STOP_S}, {n_slow} clients hanging on")
    return int(middle > MAX_RATIO or longest_s > MAX_OPEN_S or stop_s > MAX_STOP_S)


async def started(folder: Path) -> tuple[asyncio.subprocess.Process, str]:
    plant = folder / "plant.toml"
    # nobody listens there: the service is busy with its clients only
    plant.write_text(re.sub(r"port = 0\b", "port = 1", DEMO.read_text(encoding="utf-8")))
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *("-m", "service.cli.main", "run", str(plant), "--port", "0"),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        cwd=folder,
    )
    if process.stdout is None:
        raise RuntimeError("the service says nothing")
    line = (await process.stdout.readline()).decode()
    return process, line.removeprefix("padwatch: ").strip().rstrip("/")


async def p99_ms(url: str, n_requests: int) -> float:
    """The good client: one connection, one request after the other."""
    taken = []
    async with httpx2.AsyncClient(base_url=url, trust_env=False) as client:
        for _ in range(n_requests):
            begin = time.perf_counter()
            answer = await client.get(PATH)
            taken.append(1000.0 * (time.perf_counter() - begin))
            if answer.status_code != 200:
                raise RuntimeError(f"the good client was refused: {answer.status_code}")
            await asyncio.sleep(0.002)
    return sorted(taken)[int(0.99 * len(taken))]


async def beside(url: str, n_slow: int, n_requests: int) -> tuple[float, float]:
    """The good client beside slow ones, which are a process of their own."""
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *(__file__, "--against", url, "--slow", str(n_slow)),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
    )
    if process.stdin is None or process.stdout is None:
        raise RuntimeError("the slow clients cannot be talked to")
    await process.stdout.readline()
    found_ms = await p99_ms(url, n_requests)
    process.stdin.close()
    said = await process.stdout.read()
    await process.wait()
    return found_ms, float(said)


async def ended_among_hanging(
    process: asyncio.subprocess.Process, url: str, n_clients: int
) -> float:
    """Seconds from SIGTERM to the end, with clients that hold on to their connections."""
    host, _, port = url.removeprefix("http://").partition(":")
    held = []
    for n in range(n_clients):
        # one that reads nothing: its buffer is full after a kilobyte
        _, writer = await asyncio.open_connection(host, int(port), limit=1024)
        writer.write(HANGING[n % len(HANGING)])
        held.append(writer)
    begin = time.perf_counter()
    process.terminate()
    await process.wait()
    ended_s = time.perf_counter() - begin
    for writer in held:
        writer.close()
    return ended_s


async def be_slow(url: str, n_slow: int) -> None:
    """Slow clients that come again when they are closed; says the longest connection, s."""
    longest_s = [0.0]
    is_over = asyncio.Event()
    slow = [
        asyncio.create_task(come_again(url, BEGINNINGS[n % 3], longest_s, is_over))
        for n in range(n_slow)
    ]
    await asyncio.sleep(DRIP_S)
    print("begun", flush=True)
    await asyncio.to_thread(sys.stdin.read)
    is_over.set()
    await asyncio.gather(*slow)
    print(longest_s[0])


async def come_again(
    url: str, beginning: bytes, longest_s: list[float], is_over: asyncio.Event
) -> None:
    host, _, port = url.removeprefix("http://").partition(":")
    while not is_over.is_set():
        begin = time.perf_counter()
        with suppress(OSError):
            reader, writer = await asyncio.open_connection(host, int(port))
            try:
                await drip(reader, writer, beginning)
            finally:
                writer.close()
        longest_s[0] = max(longest_s[0], time.perf_counter() - begin)
        await asyncio.sleep(DRIP_S)  # one that comes at once floods, which is another thing


async def drip(
    reader: asyncio.StreamReader, writer: asyncio.StreamWriter, beginning: bytes
) -> None:
    """A byte now and then until the other side closes."""
    closed = asyncio.create_task(reader.read())
    writer.write(beginning)
    while not closed.done():
        await asyncio.wait([closed], timeout=DRIP_S)
        if beginning and not closed.done():
            writer.write(b"a")
    with suppress(OSError):
        await closed


if __name__ == "__main__":
    main()
