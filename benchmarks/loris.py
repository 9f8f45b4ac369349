"""A good client beside 500 that never finish a request, over a real service with a simulated DAQ.

A third of the slow ones drips its headers, a third its body, a third says nothing. Through nginx
with the shipped configuration: the good client's p99 at most doubles, and headers and silence end
within 10 s; bodies wait at nginx. Bare on loopback: the service ends within 5 s of SIGTERM while
clients of every kind hang on to it. In both, no sample is lost.
"""

import argparse
import asyncio
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import httpx2

SHIPPED = Path(__file__).parents[1] / "deploy" / "proxy" / "nginx.conf"
PATH = "/api/v1/session"
"""Needs no login, which what comes through a proxy otherwise needs."""

DRIP_S = 1.0
MAX_RATIO, MAX_OPEN_S, MAX_STOP_S = 2.0, 10.0, 5.0

NGINX = """
user root;
daemon off;
pid {folder}/nginx.pid;
error_log {folder}/error.log;
events {{ worker_connections 4096; }}
http {{ access_log off; include {folder}/padwatch.conf; }}
"""

HANGING = (
    b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ",
    b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 16000\r\n\r\n[",
    b"GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" * 500,
    b"GET /api/v1/units/U1/bearings/UJB/film/readings?format=csv HTTP/1.1\r\n"
    b"Host: localhost\r\n\r\n",
)
"""Of a head, of a body, idle after an answer, not reading megabytes, not reading tables."""

BEGINNINGS = (
    b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: ",
    b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 16000\r\n\r\n",
    b"",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--slow", type=int, default=500)
    parser.add_argument("--requests", type=int, default=1000)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--bare", action="store_true", help="without nginx")
    parser.add_argument("--against", metavar="URL", help="only be slow, until the input ends")
    options = parser.parse_args()
    if options.against is not None:
        sys.exit(asyncio.run(be_slow(options.against, options.slow)))
    sys.exit(asyncio.run(measure(options.slow, options.requests, options.runs, options.bare)))


async def measure(n_slow: int, n_requests: int, n_runs: int, is_bare: bool) -> int:
    with tempfile.TemporaryDirectory() as name, ExitStack() as stack:
        folder = Path(name)
        process, direct = await started(folder)
        url = direct if is_bare else stack.enter_context(proxied(folder, direct))
        try:
            ratios, longest_s = [], 0.0
            n_lost = await lost_samples(direct)
            print(f"{'run':>4}{'alone p99 ms':>14}{'beside p99 ms':>15}{'ratio':>8}{'open s':>8}")
            for run in range(n_runs):
                alone_ms = await p99_ms(url, n_requests)
                beside_ms, open_s = await beside(url, n_slow, n_requests)
                ratios.append(beside_ms / alone_ms)
                longest_s = max(longest_s, open_s)
                found = f"{run + 1:>4}{alone_ms:>14.2f}{beside_ms:>15.2f}"
                print(f"{found}{ratios[-1]:>8.2f}{open_s:>8.2f}", flush=True)
            n_lost = await lost_samples(direct) - n_lost
            stop_s = await ended_among_hanging(process, direct, n_slow)
        finally:
            if process.returncode is None:
                process.kill()
                await process.wait()
    middle = sorted(ratios)[len(ratios) // 2]
    print(f"samples lost {n_lost}, at most 0")
    print(f"ended {stop_s:.2f} s after SIGTERM, at most {MAX_STOP_S}, {n_slow} clients hanging on")
    failed = n_lost > 0 or stop_s > MAX_STOP_S
    if not is_bare:
        print(f"median ratio {middle:.2f}, at most {MAX_RATIO}")
        print(f"longest open without a whole head {longest_s:.2f} s, at most {MAX_OPEN_S}")
        failed |= middle > MAX_RATIO or longest_s > MAX_OPEN_S
    return int(failed)


async def started(folder: Path) -> tuple[asyncio.subprocess.Process, str]:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "service.cli.main", "demo", "--port", "0"),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        cwd=folder,
    )
    if process.stdout is None:
        raise RuntimeError("the service says nothing")
    while line := (await process.stdout.readline()).decode():
        if line.startswith("padwatch: http"):
            break
    else:
        raise RuntimeError("the service ended without a URL")
    return process, line.removeprefix("padwatch: ").strip().rstrip("/")


@contextmanager
def proxied(folder: Path, direct: str) -> Iterator[str]:
    """Run nginx with the shipped configuration, without TLS, before the service."""
    nginx = shutil.which("nginx", path="/usr/sbin:/usr/bin")
    if nginx is None:
        raise RuntimeError("nginx is not installed; use --bare")
    with socket.create_server(("127.0.0.1", 0)) as free:
        url = f"http://127.0.0.1:{free.getsockname()[1]}"
    text = SHIPPED.read_text(encoding="utf-8")
    text = text.replace("unix:/run/padwatch/http.sock", direct.removeprefix("http://"))
    text = text.replace("listen 80;", f"listen unix:{folder}/plain.sock;")
    text = text.replace("listen 443 ssl http2;", f"listen {url.removeprefix('http://')};")
    text = re.sub(r"^ *ssl_.*$", "", text, flags=re.MULTILINE)
    (folder / "padwatch.conf").write_text(text, encoding="utf-8")
    (folder / "nginx.conf").write_text(NGINX.format(folder=folder), encoding="utf-8")
    with subprocess.Popen([nginx, "-c", str(folder / "nginx.conf")]) as process:
        try:
            while not (folder / "nginx.pid").exists():
                time.sleep(0.01)
            yield url
        finally:
            process.terminate()


async def lost_samples(url: str) -> int:
    async with httpx2.AsyncClient(base_url=url, trust_env=False) as client:
        sources = (await client.get("/api/v1/sources")).json()
    return sum(source["n_gap"] for source in sources)


async def p99_ms(url: str, n_requests: int) -> float:
    """The good client: one connection, one request after the other."""
    taken = []
    elsewhere = httpx2.AsyncHTTPTransport(local_address="127.0.0.2")  # nginx limits each address
    async with httpx2.AsyncClient(base_url=url, transport=elsewhere) as client:
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
                await drip(reader, writer, beginning, is_over)
            finally:
                writer.close()
        if not beginning.startswith(b"POST"):
            longest_s[0] = max(longest_s[0], time.perf_counter() - begin)
        await asyncio.sleep(DRIP_S)  # one that comes at once floods, which is another thing


async def drip(
    reader: asyncio.StreamReader,
    writer: asyncio.StreamWriter,
    beginning: bytes,
    is_over: asyncio.Event,
) -> None:
    """A byte now and then until the other side closes."""
    closed = asyncio.create_task(reader.read())
    writer.write(beginning)
    while not closed.done() and not is_over.is_set():
        await asyncio.wait([closed], timeout=DRIP_S)
        if beginning and not closed.done():
            writer.write(b"a")
    closed.cancel()
    with suppress(OSError, asyncio.CancelledError):
        await closed


if __name__ == "__main__":
    main()
