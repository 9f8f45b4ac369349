"""Processes: HTTP server, access, TLS, and the stream between processes."""

from ipaddress import ip_address
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from service.settings.base import Settings

FilePath = Annotated[str, StringConstraints(min_length=1, max_length=4096)]


class TlsSettings(Settings):
    """TLS (1.2 or newer) of the HTTP server; not needed behind a proxy with TLS."""

    certificate: FilePath
    """File of the certificate with its chain (PEM), relative to the working directory; example:
    "/etc/padwatch/padwatch.crt"."""

    key: FilePath
    """File of its private key (PEM, without a passphrase), readable by padwatch's user alone."""


class AccessSettings(Settings):
    """Logins: requirement and duration."""

    login: bool = False
    """Whether clients on this computer must log in to read. Clients on other computers or behind a
    proxy must always log in, and so must all clients that change anything."""

    idle_min: Annotated[float, Field(ge=1.0, le=1440.0)] = 30.0
    """Minutes without use after which a login ends. An open dashboard counts as use."""

    longest_h: Annotated[float, Field(ge=0.25, le=168.0)] = 12.0
    """Hours after which a login ends in any case."""


DeadlineS = Annotated[float, Field(ge=0.5, le=60.0)]
"""Seconds."""

HostName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9:][A-Za-z0-9.:-]{0,252}$")]
"""A host name or address without port."""


class HttpLimitSettings(Settings):
    """Limits of the HTTP server; an incomplete request is closed within head_s + body_s."""

    head_s: DeadlineS = 4.0
    """Time in which the request line and headers must arrive, s, from the connection or from the
    first byte."""

    body_s: DeadlineS = 4.0
    """Time in which the body of a request must arrive after its headers, s."""

    unsent_s: DeadlineS = 8.0
    """Time after which a client is closed that reads nothing of a response, or less than 48 KiB of
    a long one, s."""

    keep_alive_s: DeadlineS = 8.0
    """Time after which a connection without a request is closed, s."""

    answer_s: Annotated[float, Field(ge=1.0, le=600.0)] = 20.0
    """Time after which a response that has not begun is cancelled, s: 503."""

    max_head_kb: Annotated[int, Field(ge=1, le=1024)] = 16
    """Maximum size of the request line and headers, KiB; otherwise 431."""

    max_target_kb: Annotated[int, Field(ge=1, le=1024)] = 8
    """Maximum size of path and query, KiB; otherwise 414."""

    max_body_kb: Annotated[int, Field(ge=1, le=16_384)] = 64
    """Maximum size of a request body, KiB; otherwise 413."""

    max_json_depth: Annotated[int, Field(ge=1, le=200)] = 16
    """Maximum nesting of lists and objects in a body; otherwise 400."""

    max_connections: Annotated[int, Field(ge=2, le=100_000)] = 640
    """Maximum number of connections. Above it the connection is closed that has waited longest
    without a complete request. The process needs as many open files and about 100 more."""

    max_connections_per_peer: Annotated[int, Field(ge=1, le=100_000)] = 320
    """Maximum number of connections from one address; a proxy counts as one."""

    max_requests: Annotated[int, Field(ge=1, le=10_000)] = 64
    """Maximum number of concurrent requests; otherwise 503 with Retry-After."""


ServerUrl = Annotated[
    str, StringConstraints(pattern=r"^(nats|tls)://[A-Za-z0-9_.:\[\]-]{1,253}$", max_length=260)
]
"""Address of a server, without a name or password, which are read from files."""

CredentialPath = Annotated[str, StringConstraints(min_length=1, max_length=1000)]


class StreamSettings(Settings):
    """NATS JetStream between acquiring and analysing processes; not used by `padwatch run`."""

    servers: Annotated[tuple[ServerUrl, ...], Field(min_length=1, max_length=16)] = (
        "nats://127.0.0.1:4222",
    )
    """Servers of one cluster, tls:// if they use certificates; example:
    ["nats://10.0.0.1:4222", "nats://10.0.0.2:4222", "nats://10.0.0.3:4222"]."""

    credentials_file: CredentialPath | None = None
    """File with the credentials of an account (.creds), if the servers require them."""

    token_file: CredentialPath | None = None
    """File with a token only, if the servers require one."""

    ca_file: CredentialPath | None = None
    """Certificate authorities (PEM) to trust instead of the system's."""

    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,64}$")] | None = None
    """Name of the stream, unique for each plant; derived from the plant's name by default."""

    replicas: Literal[1, 3, 5] = 1
    """Number of servers that store each block; 3 in a cluster of three."""

    max_gb: Annotated[float, Field(ge=0.001, le=100_000.0)] = 20.0
    """Maximum size of the stream on each server, GB. While the stream is full, publishing fails and
    blocks wait at the devices; no stored block is dropped."""

    max_age_h: Annotated[float, Field(ge=0.1, le=8760.0)] = 6.0
    """Age above which blocks are removed, h; must exceed the longest outage of the analysis. A unit
    of 16 channels at 600 Hz takes 0.19 GB in an hour."""

    duplicate_window_s: Annotated[float, Field(ge=10.0, le=3600.0)] = 120.0
    """Time in which the servers detect a block that is published twice, s."""

    ack_timeout_s: Annotated[float, Field(ge=0.5, le=120.0)] = 5.0
    """Time without confirmation after which a block is published again, s."""

    buffer_mb: Annotated[float, Field(ge=1.0, le=10_000.0)] = 64.0
    """Maximum memory for blocks that wait for the servers, MB; further blocks wait at the devices
    until their rings overrun."""

    silent_after_s: Annotated[float, Field(ge=2.0, le=3600.0)] = 5.0
    """Time without a block after which a unit counts as not connected, s; at least the length of
    three blocks."""

    acquire_port: Annotated[int, Field(ge=0, le=65535)] = 8091
    """Port of the health page of padwatch acquire, on this computer only; 0 takes a free one."""

    analyse_port: Annotated[int, Field(ge=0, le=65535)] = 8092
    """Port of the health page of padwatch analyse, on this computer only; 0 takes a free one."""


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


def why_closed(
    host: str, *, is_unix_socket: bool = False, has_tls: bool = False, has_account: bool = False
) -> str | None:
    """Return why the service must not listen on an address, or None.

    A Unix socket is reachable only for a proxy on the same host.
    """
    if is_unix_socket or is_loopback(host):
        return None
    missing = [] if has_tls else ["a certificate and its key in [service.tls]"]
    if not has_account:
        missing.append("an account (padwatch users add PLANT NAME --role admin)")
    if not missing:
        return None
    return (
        f'service.host "{host}" is reachable from other hosts, which requires'
        f" {' and '.join(missing)}; else listen on 127.0.0.1, or on a unix socket behind a proxy"
    )
