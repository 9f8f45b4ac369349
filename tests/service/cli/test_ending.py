"""A program that is over ends, whatever its threads are at."""

import gc
import subprocess
import sys

import pytest

from service.cli import commands, main

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

ENDS_WITH_3 = """
import atexit
from service.cli import commands, main

def app():
    atexit.register(print, "taken down")
    print("said", end="")
    raise SystemExit(3)

commands.app = app
main.main()
"""


def python(program: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )


def test_a_thread_without_end_does_not_hold_the_end_up() -> None:
    ended = python(WAITS_FOR_EVER)

    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith("over")
    assert "left behind" in ended.stdout + ended.stderr


def test_a_command_ends_with_its_code_before_libraries_are_taken_down() -> None:
    ended = python(ENDS_WITH_3)

    assert (ended.returncode, ended.stdout) == (3, "said"), ended.stderr


@pytest.mark.parametrize(
    ("raised", "expected"),
    [(None, 0), (SystemExit(0), 0), (SystemExit(None), 0), (SystemExit("why"), 1), (OSError(), 70)],
    ids=repr,
)
def test_every_end_of_a_command_has_its_exit_code(
    monkeypatch: pytest.MonkeyPatch, raised: BaseException | None, expected: int
) -> None:
    def app() -> None:
        if raised is not None:
            raise raised

    codes: list[int] = []
    monkeypatch.setattr(commands, "app", app)
    monkeypatch.setattr(main, "leave", codes.append)
    try:
        main.main()
    finally:
        gc.unfreeze()  # main makes permanent what is loaded

    assert codes == [expected]
