"""Host name resolution outside the default thread pool.

The name resolution of the event loop occupies a thread of the default pool, which the database also
uses, until the name servers time out, even after its caller was cancelled.
"""

import asyncio
import concurrent.futures
import ipaddress
import socket
import threading

MAX_ADDRESSES = 4
"""Maximum number of addresses used per host name."""


class HostAddresses:
    """Resolver of one host name; concurrent calls share one look-up."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._asking: concurrent.futures.Future[list[str]] | None = None
        self._found: list[str] = []

    async def within(self, limit_s: float | None) -> list[str]:
        """Return up to `MAX_ADDRESSES` IP addresses of the host, in the order in which to try them.

        The look-up runs in a daemon thread, and continues if the caller is cancelled. If it fails
        or takes longer than `limit_s`, the last known addresses are returned.

        Raises OSError if resolution fails and no address is known.
        """
        if _is_address(self._host):
            return [self._host]
        if self._asking is None or self._asking.done():
            self._asking = concurrent.futures.Future()
            self._asking.set_running_or_notify_cancel()  # cannot be cancelled by a caller
            threading.Thread(
                target=_look_up,
                args=(self._host, self._port, self._asking),
                name=f"look up {self._host}",
                daemon=True,  # must not delay the end of the program
            ).start()
        try:
            async with asyncio.timeout(limit_s):
                self._found = await asyncio.wrap_future(self._asking)
        except TimeoutError:
            if not self._found:
                raise OSError(f"no name server answered within {limit_s} s; check DNS") from None
        except OSError:
            if not self._found:
                raise
        return self._found


def _look_up(host: str, port: int, answer: "concurrent.futures.Future[list[str]]") -> None:
    try:
        infos = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except OSError as error:
        answer.set_exception(error)
    except UnicodeError:
        answer.set_exception(OSError(f"{host} is not a valid host name"))
    else:
        found = list(dict.fromkeys(str(info[4][0]) for info in infos))
        answer.set_result(found[:MAX_ADDRESSES])


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True
