"""Who must log in, for how long a login lasts, and how the HTTP server shows that it is itself."""

from typing import Annotated

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
