"""Host names and cancellation where a name server or a library would block a task.

The event loop's own look-up takes a thread of the pool that the store uses too, and keeps it until
the name servers fail, even if its caller has given up.
"""

import asyncio
import ipaddress
import socket
import threading

MAX_ADDRESSES = 4
"""Most addresses of one name that are tried."""


class NameLookUp:
    """Looks up one name; at most one look-up is under way, however often it is called for."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._asking: asyncio.Future[list[str]] | None = None

    async def addresses(self) -> list[str]:
        """Addresses in the order in which to try them.

        Raises
        ------
        OSError
            If there are none.
        """
        if _is_address(self._host):
            return [self._host]
        if self._asking is None or self._asking.done():
            loop = asyncio.get_running_loop()
            self._asking = loop.create_future()
            self._asking.add_done_callback(_retrieve)
            threading.Thread(
                target=_look_up,
                args=(self._host, self._port, loop, self._asking),
                name=f"look up {self._host}",
                daemon=True,  # it must not hold up the end of the program either
            ).start()
        return await asyncio.shield(self._asking)


class KnownAddresses:
    """Addresses of a name as they were found last, until newer ones are found."""

    def __init__(self, host: str, port: int) -> None:
        self._look_up = NameLookUp(host, port)
        self._found: list[str] = []

    async def within(self, limit_s: float) -> list[str]:
        """Addresses in the order in which to try them, after this time at the latest.

        Raises
        ------
        OSError
            If there have never been any.
        """
        try:
            async with asyncio.timeout(limit_s):
                self._found = await self._look_up.addresses()
        except TimeoutError:
            if not self._found:
                raise OSError(f"no name server answers within {limit_s} s") from None
        except OSError:
            if not self._found:
                raise
        return self._found


def _look_up(
    host: str, port: int, loop: asyncio.AbstractEventLoop, answer: "asyncio.Future[list[str]]"
) -> None:
    found: list[str] | OSError
    try:
        infos = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        found = list(dict.fromkeys(str(info[4][0]) for info in infos))[:MAX_ADDRESSES]
    except (OSError, UnicodeError) as error:
        found = error if isinstance(error, OSError) else OSError(f"{host} is no name")
    try:
        loop.call_soon_threadsafe(_answer, answer, found)
    except RuntimeError:
        return  # the program has ended meanwhile


def _answer(answer: "asyncio.Future[list[str]]", found: list[str] | OSError) -> None:
    if answer.done():
        return
    if isinstance(found, OSError):
        answer.set_exception(found)
    else:
        answer.set_result(found)


def _retrieve(answer: "asyncio.Future[list[str]]") -> None:
    """Retrieve an error whose caller has given up, or asyncio logs it as never retrieved."""
    if not answer.cancelled():
        answer.exception()


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def n_stops() -> int:
    """Number of times that the current task was cancelled.

    Before Python 3.13 a task group that fails while its task waits for it leaves its count behind.
    """
    task = asyncio.current_task()
    return 0 if task is None else task.cancelling()


def let_stop_through(n_before: int = 0) -> None:
    """Raise the cancellation that a library has swallowed.

    Before Python 3.12 `asyncio.wait_for` loses a cancellation if what it waits for comes at the
    same moment (CPython issue 86296); the task would then never end. To be called after every wait
    of a library that uses it.

    Parameters
    ----------
    n_before
        `n_stops` before the wait, where the task has waited for task groups of its own.
    """
    if n_stops() > n_before:
        raise asyncio.CancelledError
