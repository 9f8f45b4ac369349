"""The stream that carries blocks from `padwatch acquire` to `padwatch analyse`."""

from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from service.settings.base import Settings

ServerUrl = Annotated[
    str, StringConstraints(pattern=r"^(nats|tls)://[A-Za-z0-9_.:\[\]-]{1,253}$", max_length=260)
]
"""Where a server is, without a name or a password: these have files of their own."""

FilePath = Annotated[str, StringConstraints(min_length=1, max_length=1000)]


class StreamSettings(Settings):
    """NATS JetStream, between processes that acquire and processes that analyse.

    `padwatch run` needs none of it.
    """

    servers: Annotated[tuple[ServerUrl, ...], Field(min_length=1, max_length=16)] = (
        "nats://127.0.0.1:4222",
    )
    """Servers of one cluster, whichever is there; tls:// where certificates are used; example:
    ["nats://10.0.0.1:4222", "nats://10.0.0.2:4222", "nats://10.0.0.3:4222"]."""

    credentials_file: FilePath | None = None
    """File with the credentials of an account (.creds), for servers that ask for them."""

    token_file: FilePath | None = None
    """File that holds a token and nothing else, for servers that ask for one."""

    ca_file: FilePath | None = None
    """Certificates that the servers' are checked against instead of this computer's own."""

    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,64}$")] | None = None
    """Name of the stream; from the plant's name if not given. Two plants never share one."""

    replicas: Literal[1, 3, 5] = 1
    """Servers that keep each block before it counts as published; 3 in a cluster of three."""

    max_gb: Annotated[float, Field(ge=0.001, le=100_000.0)] = 20.0
    """Most disk that the stream takes on each server, GB. Where it is full, publishing fails and
    blocks wait at the devices; nothing that is in the stream is dropped for it."""

    max_age_h: Annotated[float, Field(ge=0.1, le=8760.0)] = 6.0
    """How long blocks are kept, h: longer than analysis is ever away. A unit of 16 channels at
    600 Hz takes 0.19 GB in an hour."""

    duplicate_window_s: Annotated[float, Field(ge=10.0, le=3600.0)] = 120.0
    """For how long the servers remember which blocks they have, so that one that is published twice
    is kept once; s."""

    ack_timeout_s: Annotated[float, Field(ge=0.5, le=120.0)] = 5.0
    """After how long without the servers' word a block is published once more, s."""

    buffer_mb: Annotated[float, Field(ge=1.0, le=10_000.0)] = 64.0
    """Most memory for blocks that wait for the servers, MB; then blocks wait at the devices, whose
    own rings overrun later."""

    silent_after_s: Annotated[float, Field(ge=2.0, le=3600.0)] = 5.0
    """After how long without a block a unit counts as not connected, also right after a start; s.
    Where blocks come more slowly, at least as long as three of them take."""

    acquire_port: Annotated[int, Field(ge=0, le=65535)] = 8091
    """Port of the health page of padwatch acquire, on this computer only; 0 takes a free one."""

    analyse_port: Annotated[int, Field(ge=0, le=65535)] = 8092
    """Port of the health page of padwatch analyse, on this computer only; 0 takes a free one."""
