"""A connection to the servers that is used until it fails, and then never again.

The library could reconnect by itself; but what was under way then stays under way without an end
(nats-io/nats.py#504). So each connection is a session, and one loop begins the next.
"""

import asyncio
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

from nats.aio.client import Client
from nats.errors import AuthorizationError, Error, NoServersError
from nats.js.client import JetStreamContext

from acquisition.delivery.network import let_stop_through, n_stops
from service.cluster.stream.errors import StreamError, StreamMisfitError
from service.settings.processes import StreamSettings

OLDEST_SERVER = (2, 10)
"""First version whose streams and consumers carry what is asked for."""

CONNECT_S = 3
PING_S = 5


@asynccontextmanager
async def session(settings: StreamSettings, name: str) -> AsyncIterator[JetStreamContext]:
    """Connect; what runs within is cancelled as soon as the connection is lost.

    Parameters
    ----------
    name
        Shown for the connection by the servers.

    Raises
    ------
    StreamError
        If there is no connection, or it is lost, or what runs within fails by the library's
        account.
    """
    lost: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    client = await _connected(settings, name, lost)
    try:
        async with asyncio.TaskGroup() as tasks:
            watching = tasks.create_task(_ended(lost, settings), name="stream watch")
            yield client.jetstream(timeout=settings.ack_timeout_s)
            watching.cancel()
    except* (StreamError, Error, OSError) as group:  # one clause: two would make a group again
        raise _told(group, settings) from None
    finally:
        await _closed(client)


async def _connected(settings: StreamSettings, name: str, lost: asyncio.Future[None]) -> Client:
    reasons: list[Exception] = []

    async def note(error: Exception) -> None:
        reasons.append(error)

    async def tell() -> None:
        if not lost.done():
            lost.set_result(None)

    client, n_before = Client(), n_stops()
    try:
        await client.connect(
            servers=list(settings.servers),
            name=name,
            error_cb=note,
            closed_cb=tell,
            disconnected_cb=tell,
            allow_reconnect=False,
            max_reconnect_attempts=1,
            reconnect_time_wait=0,
            connect_timeout=CONNECT_S,
            ping_interval=PING_S,
            max_outstanding_pings=2,
            tls=_tls(settings),
            token=_token(settings),
            user_credentials=settings.credentials_file,
        )
        let_stop_through(n_before)
        _require_version(client)
    except (Error, OSError, TimeoutError) as error:
        await _closed(client)
        let_stop_through(n_before)
        reason = reasons[-1] if isinstance(error, NoServersError) and reasons else error
        raise _renamed(reason, settings) from None
    except (StreamMisfitError, asyncio.CancelledError):
        await _closed(client)
        raise
    return client


async def _ended(lost: asyncio.Future[None], settings: StreamSettings) -> None:
    await lost
    raise StreamError(f"the connection to NATS at {_places(settings)} was lost")


async def _closed(client: Client) -> None:
    """Close without waiting for a server that may be gone."""
    with suppress(Error, OSError, TimeoutError):
        await asyncio.wait_for(client.close(), CONNECT_S)
    # the library leaves the socket open where the server has gone before all was sent to it
    transport = client._transport  # noqa: SLF001
    if transport is not None:
        transport.close()  # type: ignore[no-untyped-call]


def _require_version(client: Client) -> None:
    version = client.connected_server_version
    if (version.major, version.minor) < OLDEST_SERVER:
        oldest = ".".join(str(part) for part in OLDEST_SERVER)
        raise StreamMisfitError(
            f"the NATS server is of version {version}: padwatch needs {oldest} or newer"
        )


def _renamed(error: BaseException, settings: StreamSettings) -> StreamError:
    if isinstance(error, AuthorizationError) or "authorization" in str(error).lower():
        return StreamMisfitError(
            f"NATS at {_places(settings)} does not let padwatch in: give [stream]"
            " credentials_file or token_file of an account that it knows"
        )
    if isinstance(error, OSError):
        words = error.strerror or str(error)
        return StreamError(f"NATS at {_places(settings)} is not reached ({words}): is it running?")
    words = str(error) or type(error).__name__
    return StreamError(f"NATS at {_places(settings)} cannot be used: {words}")


def _told(group: BaseExceptionGroup[BaseException], settings: StreamSettings) -> StreamError:
    """The one of several that says most: a loss makes many fail at once."""
    found = sorted(_leaves(group), key=lambda error: not isinstance(error, StreamMisfitError))
    own = [error for error in found if isinstance(error, StreamError)]
    return own[0] if own else _renamed(found[0], settings)


def _places(settings: StreamSettings) -> str:
    return ", ".join(settings.servers)


def _leaves(error: BaseException) -> list[BaseException]:
    if isinstance(error, BaseExceptionGroup):
        return [leaf for part in error.exceptions for leaf in _leaves(part)]
    return [error]


def _tls(settings: StreamSettings) -> ssl.SSLContext | None:
    wants = any(server.startswith("tls:") for server in settings.servers)
    if not wants and settings.ca_file is None:
        return None
    try:
        return ssl.create_default_context(cafile=settings.ca_file)
    except (OSError, ssl.SSLError) as error:
        raise StreamMisfitError(f"[stream] ca_file {settings.ca_file}: {error}") from None


def _token(settings: StreamSettings) -> str | None:
    if settings.token_file is None:
        return None
    try:
        return Path(settings.token_file).read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise StreamMisfitError(f"[stream] token_file {settings.token_file}: {error}") from None
