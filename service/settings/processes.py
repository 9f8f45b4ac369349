"""Processes: HTTP server, access, TLS, and the stream between processes."""

from dataclasses import dataclass
from ipaddress import ip_address
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from service.settings.base import Settings

FilePath = Annotated[str, StringConstraints(min_length=1, max_length=4096)]


class TlsSettings(Settings):
    """TLS (1.2 or newer) of the HTTP server itself; behind a proxy the proxy's is enough."""

    certificate: FilePath
    """File of the certificate and those that vouch for it (PEM), relative to where padwatch is
    started; example: "/etc/padwatch/padwatch.crt"."""

    key: FilePath
    """File of its private key (PEM, without a passphrase), likewise; keep it readable by padwatch's
    user alone."""


class AccessSettings(Settings):
    """Who must log in, and for how long."""

    login: bool = False
    """Whether people and programs on this computer must log in to see the plant, too. From anywhere
    else, and through a proxy, everybody always must; to change anything everybody must."""

    idle_min: Annotated[float, Field(ge=1.0, le=1440.0)] = 30.0
    """A login ends so many minutes after its last use. A dashboard that is open uses it."""

    longest_h: Annotated[float, Field(ge=0.25, le=168.0)] = 12.0
    """A login ends so many hours after it began, whatever is done with it."""


DeadlineS = Annotated[float, Field(ge=0.5, le=60.0)]
"""Seconds."""

HostName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9:][A-Za-z0-9.:-]{0,252}$")]
"""A host name or address without port."""


class HttpLimitSettings(Settings):
    """Limits of the HTTP server; a client that never finishes is closed within head_s + body_s."""

    head_s: DeadlineS = 4.0
    """Within this time, s, a request's line and headers must have come, from its first byte or from
    the connection."""

    body_s: DeadlineS = 4.0
    """Within this time, s, a request's body must have come, from the end of its headers."""

    unsent_s: DeadlineS = 8.0
    """A client that takes nothing of its answer for this time, s, is closed; one that takes less
    than 48 KiB of a long answer in it too."""

    keep_alive_s: DeadlineS = 8.0
    """A connection without a question for this time, s, is closed."""

    answer_s: Annotated[float, Field(ge=1.0, le=600.0)] = 20.0
    """An answer that has not begun within this time, s, is given up: 503."""

    max_head_kb: Annotated[int, Field(ge=1, le=1024)] = 16
    """Line and headers of a request together, KiB; more is refused: 431."""

    max_target_kb: Annotated[int, Field(ge=1, le=1024)] = 8
    """Path and query of a request, KiB; more is refused: 414."""

    max_body_kb: Annotated[int, Field(ge=1, le=16_384)] = 64
    """Body of a request, KiB; more is refused: 413."""

    max_json_depth: Annotated[int, Field(ge=1, le=200)] = 16
    """How deep lists and objects of a body may be nested; more is refused: 400."""

    max_connections: Annotated[int, Field(ge=2, le=100_000)] = 640
    """Connections at the same time. Beyond it the one is closed that has waited longest without a
    complete request; the process needs as many open files and about 100 more."""

    max_connections_per_peer: Annotated[int, Field(ge=1, le=100_000)] = 320
    """Connections at the same time from one address; a proxy counts as one."""

    max_requests: Annotated[int, Field(ge=1, le=10_000)] = 64
    """Requests that are worked on at the same time; more are refused: 503 with Retry-After."""


ServerUrl = Annotated[
    str, StringConstraints(pattern=r"^(nats|tls)://[A-Za-z0-9_.:\[\]-]{1,253}$", max_length=260)
]
"""Where a server is, without a name or a password: these have files of their own."""

CredentialPath = Annotated[str, StringConstraints(min_length=1, max_length=1000)]


class StreamSettings(Settings):
    """NATS JetStream, between processes that acquire and processes that analyse.

    `padwatch run` needs none of it.
    """

    servers: Annotated[tuple[ServerUrl, ...], Field(min_length=1, max_length=16)] = (
        "nats://127.0.0.1:4222",
    )
    """Servers of one cluster, whichever is there; tls:// where certificates are used; example:
    ["nats://10.0.0.1:4222", "nats://10.0.0.2:4222", "nats://10.0.0.3:4222"]."""

    credentials_file: CredentialPath | None = None
    """File with the credentials of an account (.creds), for servers that ask for them."""

    token_file: CredentialPath | None = None
    """File that holds a token and nothing else, for servers that ask for one."""

    ca_file: CredentialPath | None = None
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


@dataclass(frozen=True)
class Doorway:
    """Address and protection of the service.

    Parameters
    ----------
    host
        Address that the service listens on.
    is_unix_socket
        Whether it listens on a Unix socket, which only a trusted proxy can open.
    has_tls
        Whether it has a certificate and its key.
    has_account
        Whether an account exists.
    """

    host: str
    is_unix_socket: bool = False
    has_tls: bool = False
    has_account: bool = False


def is_loopback(host: str) -> bool:
    """Return whether an address is reachable from its own host only.

    Of names only `localhost` counts; padwatch does not resolve others.
    """
    if host == "localhost":
        return True
    try:
        address = ip_address(host)
    except ValueError:
        return False
    return address.is_loopback


def why_closed(doorway: Doorway) -> str | None:
    """Return why the service must not start at an address, or None."""
    if doorway.is_unix_socket or is_loopback(doorway.host):
        return None
    missing = [
        what
        for is_there, what in (
            (doorway.has_tls, "a certificate and its key in [service.tls]"),
            (doorway.has_account, "an account (padwatch users add PLANT NAME --role admin)"),
        )
        if not is_there
    ]
    if not missing:
        return None
    return (
        f'service.host "{doorway.host}" is reached from other hosts, which needs'
        f" {' and '.join(missing)}; else listen on 127.0.0.1, or on a unix socket behind a proxy"
    )
