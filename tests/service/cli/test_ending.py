"""A program that is over ends, whatever its threads are at."""

import subprocess
import sys

WAITS_FOR_EVER = """
import asyncio, threading
from service.cli.ending import run_to_its_end

async def program():
    begun = threading.Event()
    def work():
        begun.set()
        threading.Event().wait()
    asyncio.create_task(asyncio.to_thread(work))
    await asyncio.to_thread(begun.wait)
    print("over", flush=True)

run_to_its_end(program())
"""


def test_a_thread_without_end_does_not_hold_the_end_up() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", WAITS_FOR_EVER],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )

    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("over")
    assert "left behind" in ended.stdout + ended.stderr
