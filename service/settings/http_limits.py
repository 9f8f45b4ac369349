"""What one client may cost: sizes, deadlines and counts of the HTTP server."""

from typing import Annotated

from pydantic import Field, StringConstraints

from service.settings.base import Settings

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
