"""A program that is over ends, whatever its threads are at."""

import subprocess
import sys

import pytest

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


ENDS_WITH = """
import atexit
from service.cli import commands, main

def app():
    atexit.register(print, "taken down")
    print("said", end="")
    raise SystemExit({code!r})

commands.app = app
main.main()
"""


@pytest.mark.parametrize(("code", "seen"), [(0, 0), (3, 3), (None, 0), ("why", 1)])
def test_a_command_ends_with_its_code_before_libraries_are_taken_down(
    code: object, seen: int
) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", ENDS_WITH.format(code=code)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )

    assert (ended.returncode, ended.stdout) == (seen, "said"), ended.stderr
