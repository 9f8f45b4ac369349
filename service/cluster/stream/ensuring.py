"""The stream itself: made if it is not there, checked if it is."""

import nats.errors
from nats.js.api import DiscardPolicy, RetentionPolicy, StorageType, StreamConfig
from nats.js.client import JetStreamContext
from nats.js.errors import (
    APIError,
    BadRequestError,
    NoStreamResponseError,
    NotFoundError,
    ServiceUnavailableError,
)

from service.cluster.stream.errors import StreamError, StreamMisfitError
from service.cluster.stream.names import plant_mark, stream_name, subjects
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings

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
