"""A connection to JetStream, and the stream itself."""

import asyncio
import re
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path

import nats.errors
from nats.aio.client import Client
from nats.errors import AuthorizationError, Error, NoServersError
from nats.js.api import DiscardPolicy, RetentionPolicy, StorageType, StreamConfig
from nats.js.client import JetStreamContext
from nats.js.errors import (
    APIError,
    BadRequestError,
    NoStreamResponseError,
    NotFoundError,
    ServiceUnavailableError,
)

from acquisition.delivery.network import let_stop_through, n_stops
from core.samples.blocks import SampleBlock
from service.cluster.frames import UnitIdentity, fingerprint
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings
from service.settings.units import UnitSettings


class StreamError(Exception):
    """The servers do not answer, or not as they should; trying later is reasonable."""


class StreamMisfitError(StreamError):
    """Servers, stream and plant file do not fit together; the message says what to do."""


class StreamAnewError(Exception):
    """The stream is another one than before: what is known of it counts no more."""


ROOT = "padwatch"


def plant_mark(plant: PlantFile) -> bytes:
    """Fingerprint of a plant."""
    return fingerprint(ROOT, plant.plant.name)


def stream_name(plant: PlantFile) -> str:
    """Name of the plant's stream: legible, and unlike that of any other plant."""
    if plant.stream is not None and plant.stream.name is not None:
        return plant.stream.name
    legible = re.sub(r"[^A-Za-z0-9]+", "-", plant.plant.name).strip("-")[:32]
    return "-".join(part for part in (ROOT, legible, plant_mark(plant).hex()[:8]) if part)


def subjects(plant: PlantFile) -> str:
    """Subjects of all units of a plant."""
    return f"{ROOT}.{stream_name(plant)}.*"


def subject(plant: PlantFile, unit: str) -> str:
    """Subject of a unit; a dot in its id would part the subject."""
    return f"{ROOT}.{stream_name(plant)}.{unit.replace('.', '=')}"


def consumer_name(unit: str) -> str:
    """What a unit's analysis is called on the servers."""
    return f"analyse-{unit.replace('.', '=')}"


def message_id(identity: UnitIdentity, block: SampleBlock) -> str:
    """The same for the same block, however often it is published, and for no other.

    Its time tells it from one of a device that counts the same indices anew.
    """
    place = f"{block.epoch}.{block.first_index}.{block.start_ns}"
    return f"{identity.plant.hex()[:8]}.{block.unit}.{place}"


def identity_of(plant: PlantFile, unit: UnitSettings) -> UnitIdentity:
    """What the blocks of a unit must be marked with."""
    channels = [(channel.id, str(channel.measurand)) for channel in unit.channel]
    make = fingerprint(unit.id, unit.sampling_hz, unit.source.kind, channels)
    return UnitIdentity(unit.id, plant_mark(plant), make)


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


BYTES_PER_GB = 1e9
S_PER_H = 3600.0

PLANT, FORMAT = "padwatch-plant", "padwatch-format"
"""Where the stream says whose it is."""


def wanted(plant: PlantFile, settings: StreamSettings) -> StreamConfig:
    """The stream as it should be.

    When it is full, the servers refuse what is new: it is then still at the devices, and somebody
    hears of it. The other choice would drop blocks that nobody has analysed, without a word.
    """
    return StreamConfig(
        name=stream_name(plant),
        description=f"blocks of {plant.plant.name}, by padwatch",
        subjects=[subjects(plant)],
        retention=RetentionPolicy.LIMITS,
        storage=StorageType.FILE,
        discard=DiscardPolicy.NEW,
        max_bytes=round(settings.max_gb * BYTES_PER_GB),
        max_age=settings.max_age_h * S_PER_H,
        duplicate_window=min(settings.duplicate_window_s, settings.max_age_h * S_PER_H),
        num_replicas=settings.replicas,
        allow_direct=True,
        metadata={PLANT: plant_mark(plant).hex(), FORMAT: "1"},
    )


async def ensure(stream: JetStreamContext, plant: PlantFile, settings: StreamSettings) -> None:
    """Make the stream, or take over the plant file's limits.

    Raises
    ------
    StreamMisfitError
        If JetStream is off, or the stream is another plant's or cannot be as it should be.
    """
    config = wanted(plant, settings)
    try:
        there = (await stream.stream_info(stream_name(plant))).config
    except NotFoundError:
        await _made(stream, config)
        return
    except (NoStreamResponseError, ServiceUnavailableError, nats.errors.NoRespondersError):
        raise StreamMisfitError(NOT_ENABLED) from None
    _require_own(there, plant)
    if _limits(there) != _limits(config):
        await _made(stream, config, update=True)


async def require(stream: JetStreamContext, plant: PlantFile) -> str:
    """Look for the stream, for those who only read it; returns which one it is.

    Raises
    ------
    StreamError
        If it is not there yet.
    StreamMisfitError
        If JetStream is off, or the stream is another plant's.
    """
    name = stream_name(plant)
    try:
        found = await stream.stream_info(name)
    except NotFoundError:
        raise StreamError(
            f"there is no stream {name!r} yet: `padwatch acquire` makes it when it starts"
        ) from None
    except (NoStreamResponseError, ServiceUnavailableError, nats.errors.NoRespondersError):
        raise StreamMisfitError(NOT_ENABLED) from None
    _require_own(found.config, plant)
    return f"{name} of {found.created}"


NOT_ENABLED = (
    "JetStream does not answer: start nats-server with -js or a jetstream block in its file, and in"
    " a cluster see that most of its servers run"
)


async def _made(stream: JetStreamContext, config: StreamConfig, *, update: bool = False) -> None:
    try:
        await (stream.update_stream(config) if update else stream.add_stream(config))
    except (NoStreamResponseError, ServiceUnavailableError, nats.errors.NoRespondersError):
        raise StreamMisfitError(NOT_ENABLED) from None
    except BadRequestError as error:
        raise StreamMisfitError(
            f"the stream {config.name!r} cannot be as [stream] says: {error.description}"
        ) from None
    except APIError as error:
        raise StreamMisfitError(
            f"the servers do not make the stream {config.name!r}: {error.description}; lower"
            " [stream] max_gb or replicas, or give the servers more"
        ) from None


def _require_own(config: StreamConfig, plant: PlantFile) -> None:
    mark = (config.metadata or {}).get(PLANT)
    if mark != plant_mark(plant).hex():
        whose = "belongs to another plant" if mark else "was not made by padwatch"
        raise StreamMisfitError(
            f"the stream {config.name!r} {whose}: give this one another [stream] name"
        )


def _limits(config: StreamConfig) -> tuple[object, ...]:
    return (
        config.max_bytes,
        config.max_age,
        config.num_replicas,
        config.discard,
        config.duplicate_window,
        tuple(config.subjects or ()),
    )
