"""Settings of logins, TLS and limits of the HTTP server, and of the stream between processes."""

from functools import lru_cache
from ipaddress import ip_address
from typing import Annotated, Literal

from pydantic import Field, StringConstraints

from service.settings.base import Settings

FilePath = Annotated[str, StringConstraints(min_length=1, max_length=4096)]


class TlsSettings(Settings):
    """Settings of TLS (1.2 or newer) of the HTTP server; not required behind a proxy with TLS."""

    certificate: FilePath
    """File with the certificate and its chain (PEM), relative to the working directory; example:
    "/etc/padwatch/padwatch.crt"."""

    key: FilePath
    """File with the private key of the certificate (PEM, without a passphrase), readable only by
    padwatch's user."""


class AccessSettings(Settings):
    """Settings of logins: when they are required, and their duration."""

    login: bool = False
    """Whether clients on this computer must log in to read. Clients on other computers or behind a
    proxy must always log in. Requests that change state always require a login."""

    idle_min: Annotated[float, Field(ge=1.0, le=1440.0)] = 30.0
    """Time without use after which a login expires, minutes. An open dashboard counts as use."""

    longest_h: Annotated[float, Field(ge=0.25, le=168.0)] = 12.0
    """Maximum duration of a login, hours."""


HostName = Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9:][A-Za-z0-9.:-]{0,252}$")]
"""Host name or IP address, without a port."""


class HttpLimitSettings(Settings):
    """Limits of the HTTP server; a reverse proxy adds time limits for slow clients."""

    answer_s: Annotated[float, Field(ge=1.0, le=600.0)] = 20.0
    """Time limit from the head of a request to the start of its response, s; otherwise the request
    is cancelled with status 503."""

    max_connections: Annotated[int, Field(ge=2, le=100_000)] = 640
    """Maximum number of connections; requests on further connections get status 503. The process
    requires as many open files, and about 100 more."""


ServerUrl = Annotated[
    str, StringConstraints(pattern=r"^(nats|tls)://[A-Za-z0-9_.:\[\]-]{1,253}$", max_length=260)
]
"""URL of a NATS server, without user name and password; credentials are read from files."""

CredentialPath = Annotated[str, StringConstraints(min_length=1, max_length=1000)]


class StreamSettings(Settings):
    """Settings of the NATS JetStream stream from `padwatch acquire` to `padwatch analyse`."""

    servers: Annotated[tuple[ServerUrl, ...], Field(min_length=1, max_length=16)] = (
        "nats://127.0.0.1:4222",
    )
    """NATS servers of one cluster, with tls:// if the servers use certificates; example:
    ["nats://10.0.0.1:4222", "nats://10.0.0.2:4222", "nats://10.0.0.3:4222"]."""

    credentials_file: CredentialPath | None = None
    """File with the credentials of a NATS account (.creds), if the servers require credentials."""

    token_file: CredentialPath | None = None
    """File that contains only a token, if the servers require a token."""

    ca_file: CredentialPath | None = None
    """File with the trusted certificate authorities (PEM), instead of those of the system."""

    name: Annotated[str, StringConstraints(pattern=r"^[A-Za-z0-9_-]{1,64}$")] | None = None
    """Name of the stream, unique for each plant; derived from the plant's name by default."""

    replicas: Literal[1, 3, 5] = 1
    """Number of replicas of each block, on different servers; 3 in a cluster of three."""

    max_gb: Annotated[float, Field(ge=0.001, le=100_000.0)] = 20.0
    """Maximum size of the stream on each server, GB. While the stream is full, publishing fails and
    samples wait at the devices; stored blocks are not dropped."""

    max_age_h: Annotated[float, Field(ge=0.1, le=8760.0)] = 6.0
    """Age above which blocks are removed, h; should exceed the longest outage of the analysis. A
    unit of 16 channels at 600 Hz takes 0.19 GB an hour."""

    duplicate_window_s: Annotated[float, Field(ge=10.0, le=3600.0)] = 120.0
    """Time window in which the servers detect a duplicate of a published block, s."""

    ack_timeout_s: Annotated[float, Field(ge=0.5, le=120.0)] = 5.0
    """Time without acknowledgement after which a block is published again, s."""

    buffer_mb: Annotated[float, Field(ge=1.0, le=10_000.0)] = 64.0
    """Maximum memory for blocks that wait for the servers, MB; further samples wait in the rings of
    the devices, until a ring overruns."""

    silent_after_s: Annotated[float, Field(ge=2.0, le=3600.0)] = 5.0
    """Time without a block after which a unit counts as not connected, s; the length of three
    blocks applies if it is longer."""

    acquire_port: Annotated[int, Field(ge=0, le=65535)] = 8091
    """TCP port of the health page of `padwatch acquire`, on loopback only; 0 uses a free port."""

    analyse_port: Annotated[int, Field(ge=0, le=65535)] = 8092
    """TCP port of the health page of `padwatch analyse`, on loopback only; 0 uses a free port."""


@lru_cache(maxsize=1024)
def is_loopback(host: str) -> bool:
    """Return whether an address is a loopback address.

    `localhost` is the only name that counts as loopback; names are not resolved.
    """
    if host == "localhost":
        return True
    try:
        address = ip_address(host)
    except ValueError:
        return False
    return address.is_loopback
