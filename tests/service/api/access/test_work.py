"""What access costs is bounded, and kept away from everybody else."""

import asyncio
import threading
from collections.abc import Iterator

import pytest

from service.api.auth.passwords import MAX_AT_ONCE, MAX_WAITING, AccessThreads, TooManyLoginsError
from service.store.port import StoreError


@pytest.fixture
def held() -> Iterator[threading.Event]:
    """Keeps threads that wait for it."""
    event = threading.Event()
    yield event
    event.set()


async def test_only_so_many_passwords_wait_and_nobody_else_for_them(
    held: threading.Event,
) -> None:
    work = AccessThreads()
    logins = [
        asyncio.create_task(work.run_hashing(held.wait, is_known=False)) for _ in range(MAX_WAITING)
    ]
    await asyncio.sleep(0)

    with pytest.raises(TooManyLoginsError):
        await work.run_hashing(held.wait, is_known=False)
    assert await work.run(lambda: "found") == "found"
    held.set()
    assert await asyncio.gather(*logins) == [True] * MAX_WAITING
    assert await work.run_hashing(lambda: "in") == "in"
    work.close()


async def test_at_the_end_nothing_more_is_begun(held: threading.Event) -> None:
    work = AccessThreads()
    logins = [
        asyncio.create_task(work.run_hashing(held.wait, is_known=False)) for _ in range(MAX_WAITING)
    ]
    await asyncio.sleep(0)
    work.close()
    held.set()
    ended = await asyncio.gather(*logins, return_exceptions=True)

    begun = [each for each in ended if each is True]
    assert len(begun) <= MAX_AT_ONCE
    assert all(isinstance(e, asyncio.CancelledError) for e in ended if e is not True)


async def test_a_note_that_cannot_be_written_is_nobodys_trouble() -> None:
    work, tried = AccessThreads(), threading.Event()

    def write() -> None:
        tried.set()
        raise StoreError("disk full")

    work.note(write)

    assert await asyncio.to_thread(tried.wait, 30.0)
    assert await work.run(lambda: "found") == "found"
    work.close()
