"""Sessions with JetStream servers, and creation of the stream of a plant."""

import asyncio
import re
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from operator import attrgetter
from pathlib import Path
from typing import Any

import nats.errors
from nats.aio.client import Client
from nats.errors import AuthorizationError, Error, NoServersError
from nats.js.api import DiscardPolicy, RetentionPolicy, StorageType, StreamConfig, StreamInfo
from nats.js.client import JetStreamContext
from nats.js.errors import (
    APIError,
    BadRequestError,
    NoStreamResponseError,
    NotFoundError,
    ServiceUnavailableError,
)

from acquisition.clock import Clock
from core.samples.blocks import SampleBlock
from service.cluster.frames import UnitIdentity, fingerprint
from service.runtime.heartbeats import Pulse
from service.runtime.periodic import TroubleLog
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings
from service.settings.storage import BYTES_PER_GB
from service.settings.units import UnitSettings


class StreamError(Exception):
    """Error raised if the servers do not answer or refuse a request; retrying may succeed."""


class StreamMisfitError(StreamError):
    """Error raised if servers or stream do not match the plant file; the message has a remedy."""


class StreamAnewError(Exception):
    """Error raised if the stream was replaced or lost messages, so that positions are invalid."""


def n_stops() -> int:
    """Return the number of pending cancellation requests of the current task.

    Before Python 3.13, a task group that fails while its task waits for it does not reset its own
    request.
    """
    task = asyncio.current_task()
    return 0 if task is None else task.cancelling()


def let_stop_through(n_before: int = 0) -> None:
    """Raise `asyncio.CancelledError` if a library suppressed a cancellation of the current task.

    Before Python 3.12, `asyncio.wait_for` loses a cancellation if the awaited result arrives at the
    same time (CPython issue 86296), so the task would never end. Call this function after every
    wait of a library that uses `wait_for`.

    Parameters
    ----------
    n_before
        `n_stops` before the wait, for tasks that use task groups.
    """
    if n_stops() > n_before:
        raise asyncio.CancelledError


RETRY_S = 1.0
MISFIT_RETRY_S = 5.0
"""Delay of the next attempt after a `StreamMisfitError`, s; `RETRY_S` after other errors."""

NOT_REACHED = "the NATS servers have not been reached yet"

ROOT = "padwatch"


def _plant_mark(plant: PlantFile) -> bytes:
    """Return the fingerprint of a plant's name, which identifies its messages and stream."""
    return fingerprint(ROOT, plant.plant.name)


def stream_name(plant: PlantFile) -> str:
    """Return the stream's name: as configured, else made of the plant's name and fingerprint."""
    if plant.stream is not None and plant.stream.name is not None:
        return plant.stream.name
    legible = re.sub(r"[^A-Za-z0-9]+", "-", plant.plant.name).strip("-")[:32]
    return "-".join(part for part in (ROOT, legible, _plant_mark(plant).hex()[:8]) if part)


def subject(plant: PlantFile, unit: str) -> str:
    """Return the subject of a unit, `*` for all; dots in its id are replaced, as they separate."""
    return f"{ROOT}.{stream_name(plant)}.{unit.replace('.', '=')}"


def consumer_name(unit: str) -> str:
    """Return the name of the durable consumer of a unit on the servers."""
    return f"analyse-{unit.replace('.', '=')}"


def message_id(identity: UnitIdentity, block: SampleBlock) -> str:
    """Return the unique message id of a block, the same for every publish attempt.

    The id contains the start time because a device may restart its sample index.
    """
    place = f"{block.epoch}.{block.first_index}.{block.start_ns}"
    return f"{identity.plant.hex()[:8]}.{block.unit}.{place}"


def identity_of(plant: PlantFile, unit: UnitSettings) -> UnitIdentity:
    """Return the identity of a unit, which all its messages contain."""
    channels = [(channel.id, str(channel.measurand)) for channel in unit.channel]
    make = fingerprint(unit.id, unit.sampling_hz, unit.source.kind, channels)
    return UnitIdentity(unit.id, _plant_mark(plant), make)


OLDEST_SERVER = (2, 10)
"""Oldest version of the NATS server with all stream and consumer features in use."""

CONNECT_S = 3
PING_S = 5


@asynccontextmanager
async def session(settings: StreamSettings, name: str) -> AsyncIterator[JetStreamContext]:
    """Connect to NATS as client `name`; yield the JetStream context until the connection is lost.

    Raises
    ------
    StreamError
        If the connection fails or is lost, or if the body of the context manager raises an error
        of the NATS library or the operating system.
    """
    lost: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    client = await _connected(settings, name, lost)
    try:
        async with asyncio.TaskGroup() as tasks:
            watching = tasks.create_task(_ended(lost, settings), name="stream watch")
            yield client.jetstream(timeout=settings.ack_timeout_s)
            watching.cancel()
    except* (StreamError, Error, OSError) as group:  # with two clauses, a group would be raised
        # a lost connection causes several errors; the most specific one is raised
        found = sorted(_leaves(group), key=lambda error: not isinstance(error, StreamMisfitError))
        own = [error for error in found if isinstance(error, StreamError)]
        raise (own[0] if own else _renamed(found[0], settings)) from None
    finally:
        await _closed(client)


async def keep_session(
    settings: StreamSettings,
    name: str,
    work: Callable[[JetStreamContext], Awaitable[None]],
    state: TroubleLog,
    clock: Clock,
    pulse: Pulse,
) -> None:
    """Run `work` in a session, and in a new one after each failure, until cancelled.

    Failures are recorded in `state`; the caller records success. `pulse` gets heartbeats.
    """
    while True:
        pulse.rest()
        try:
            async with session(settings, name) as stream:
                await work(stream)
        except StreamError as error:
            state.note(str(error))
            is_misfit = isinstance(error, StreamMisfitError)
            await clock.sleep(MISFIT_RETRY_S if is_misfit else RETRY_S)


async def _connected(settings: StreamSettings, name: str, lost: asyncio.Future[None]) -> Client:
    reasons: list[Exception] = []

    async def note(error: Exception) -> None:
        reasons.append(error)

    async def on_loss() -> None:
        if not lost.done():
            lost.set_result(None)

    client, n_before = Client(), n_stops()
    try:
        await client.connect(
            servers=list(settings.servers),
            name=name,
            error_cb=note,
            closed_cb=on_loss,
            disconnected_cb=on_loss,
            allow_reconnect=False,
            max_reconnect_attempts=1,
            reconnect_time_wait=0,
            connect_timeout=CONNECT_S,
            ping_interval=PING_S,
            max_outstanding_pings=2,
            **_login(settings),
        )
        let_stop_through(n_before)
        version = client.connected_server_version
        if (version.major, version.minor) < OLDEST_SERVER:
            oldest = ".".join(str(part) for part in OLDEST_SERVER)
            raise StreamMisfitError(
                f"the NATS server has version {version}; padwatch requires {oldest} or newer"
            )
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
    raise StreamError(
        f"lost the connection to NATS at {_places(settings)}; check network and servers"
    )


async def _closed(client: Client) -> None:
    """Close a client within `CONNECT_S`, even if the server does not answer."""
    with suppress(Error, OSError, TimeoutError):
        await asyncio.wait_for(client.close(), CONNECT_S)
    # the NATS client leaves the socket open if the server disconnects while data is being sent
    transport = client._transport  # noqa: SLF001
    if transport is not None:
        transport.close()  # type: ignore[no-untyped-call]


def _renamed(error: BaseException, settings: StreamSettings) -> StreamError:
    if isinstance(error, AuthorizationError) or "authorization" in str(error).lower():
        return StreamMisfitError(
            f"NATS at {_places(settings)} rejects the login: set [stream] credentials_file or"
            " token_file to those of a known account"
        )
    if isinstance(error, OSError):
        words = error.strerror or str(error)
        return StreamError(
            f"NATS at {_places(settings)} cannot be reached ({words}): check that it is running"
        )
    words = str(error) or type(error).__name__
    return StreamError(f"NATS at {_places(settings)} cannot be used: {words}; check its log")


def _places(settings: StreamSettings) -> str:
    return ", ".join(settings.servers)


def _leaves(error: BaseException) -> list[BaseException]:
    if isinstance(error, BaseExceptionGroup):
        return [leaf for part in error.exceptions for leaf in _leaves(part)]
    return [error]


def _login(settings: StreamSettings) -> dict[str, Any]:
    """Return the options of the NATS client for TLS and login; raise for unreadable files."""
    key, path, tls, token = "ca_file", settings.ca_file, None, None
    try:
        if path is not None or any(server.startswith("tls:") for server in settings.servers):
            tls = ssl.create_default_context(cafile=path)
        key, path = "token_file", settings.token_file
        if path is not None:
            token = Path(path).read_text("utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:  # an SSLError is an OSError
        raise StreamMisfitError(f"cannot read [stream] {key} {path}: {error}") from None
    return {"tls": tls, "token": token, "user_credentials": settings.credentials_file}


S_PER_H = 3600.0

PLANT, FORMAT = "padwatch-plant", "padwatch-format"
"""Keys of the stream's metadata for the fingerprint of the plant and for the format version."""


def wanted(plant: PlantFile, settings: StreamSettings) -> StreamConfig:
    """Return the stream configuration that the plant file requires.

    A full stream refuses new blocks, which then wait at the devices with an alarm. The discard
    policy "old" would drop old blocks before they are analysed.
    """
    return StreamConfig(
        name=stream_name(plant),
        description=f"blocks of {plant.plant.name}, by padwatch",
        subjects=[subject(plant, "*")],
        retention=RetentionPolicy.LIMITS,
        storage=StorageType.FILE,
        discard=DiscardPolicy.NEW,
        max_bytes=round(settings.max_gb * BYTES_PER_GB),
        max_age=settings.max_age_h * S_PER_H,
        duplicate_window=min(settings.duplicate_window_s, settings.max_age_h * S_PER_H),
        num_replicas=settings.replicas,
        allow_direct=True,
        metadata={PLANT: _plant_mark(plant).hex(), FORMAT: "1"},
    )


async def ensure(stream: JetStreamContext, plant: PlantFile, settings: StreamSettings) -> None:
    """Create the stream of a plant, or update the limits of an existing stream.

    Raises `StreamMisfitError` if JetStream does not respond, or if the stream belongs to another
    plant or cannot be configured.
    """
    config, found = wanted(plant, settings), await _info(stream, plant)
    if found is None:
        await _made(stream, config)
    elif _limits(found.config) != _limits(config):
        await _made(stream, config, update=True)


async def require(stream: JetStreamContext, plant: PlantFile) -> str:
    """Check that the stream of a plant exists; return its name with its creation time.

    Raises `StreamError` if the stream does not exist, and `StreamMisfitError` if JetStream does not
    respond or the stream belongs to another plant.
    """
    name, found = stream_name(plant), await _info(stream, plant)
    if found is None:
        raise StreamError(
            f"the stream '{name}' does not exist yet; `padwatch acquire` creates it when it starts"
        )
    return f"{name} of {found.created}"


NOT_ENABLED = (
    "JetStream does not respond; start nats-server with -js or with a jetstream block in its"
    " configuration; in a cluster most of its servers must run"
)

NO_ANSWER = (NoStreamResponseError, ServiceUnavailableError, nats.errors.NoRespondersError)


async def _info(stream: JetStreamContext, plant: PlantFile) -> StreamInfo | None:
    """Return information on the stream of a plant; None if the stream does not exist."""
    name = stream_name(plant)
    try:
        found = await stream.stream_info(name)
    except NotFoundError:
        return None
    except NO_ANSWER:
        raise StreamMisfitError(NOT_ENABLED) from None
    mark = (found.config.metadata or {}).get(PLANT)
    if mark != _plant_mark(plant).hex():
        fault = "belongs to another plant" if mark else "was not created by padwatch"
        raise StreamMisfitError(f"the stream '{name}' {fault}; set another [stream] name")
    return found


async def _made(stream: JetStreamContext, config: StreamConfig, *, update: bool = False) -> None:
    try:
        await (stream.update_stream(config) if update else stream.add_stream(config))
    except NO_ANSWER:
        raise StreamMisfitError(NOT_ENABLED) from None
    except BadRequestError as error:
        raise StreamMisfitError(
            f"the stream '{config.name}' cannot be configured by [stream]: {error.description}"
        ) from None
    except APIError as error:
        raise StreamMisfitError(
            f"the NATS servers do not create the stream '{config.name}': {error.description}; lower"
            " [stream] max_gb or replicas, or give the servers more disk space"
        ) from None


_limits = attrgetter(
    "max_bytes", "max_age", "num_replicas", "discard", "duplicate_window", "subjects"
)
"""Function that returns the part of a stream configuration that the plant file determines."""
