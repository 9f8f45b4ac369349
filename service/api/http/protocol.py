"""HTTP/1.1 protocol of uvicorn with limits on time, size and number of connections."""

import asyncio
from collections import defaultdict
from collections.abc import Callable, Iterable
from enum import Enum, auto
from typing import Any, cast

import httptools
import uvicorn
from starlette.types import ASGIApp
from uvicorn._types import ASGI3Application
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle
from uvicorn.server import ServerState

from service.api.http.middleware import SECURITY_HEADERS, BoundedAnswers, guarded
from service.api.http.refusals import (
    FULL,
    HEAD_TOO_LARGE,
    NOT_HTTP,
    TARGET_TOO_LONG,
    TOO_SLOW,
    Refusal,
)
from service.settings.processes import HttpLimitSettings

MAX_UNSENT_BYTES = 64 * 1024 * 1024
"""Maximum total of unsent bytes, above which connections with the most such bytes are aborted."""

MAX_PAUSE_S = 1.0
"""Maximum time between two deadline checks that counts towards deadlines, s."""


class Connections:
    """Collection of the open connections of a server, with limits on their number.

    Parameters
    ----------
    now_s
        Function that returns the monotonic time, s.
    """

    def __init__(self, limits: HttpLimitSettings, now_s: Callable[[], float]) -> None:
        self.limits, self.now_s = limits, now_s
        self._of_peer: defaultdict[str, set[GuardedProtocol]] = defaultdict(set)
        self._n_open = self.n_accepted = 0
        self._swept_s = now_s()

    def __len__(self) -> int:
        return self._n_open

    def admit(self, connection: "GuardedProtocol") -> bool:
        """Add a connection; return False if it is one too many, even after closing an idle one."""
        neighbours = self._of_peer[connection.peer]
        if len(neighbours) >= self.limits.max_connections_per_peer:
            has_room = _make_room(neighbours)
        elif self._n_open >= self.limits.max_connections:
            has_room = _make_room(self.all())
        else:
            has_room = True
        # closing connections count until they are closed
        neighbours.add(connection)
        self._n_open += 1
        self.n_accepted += 1
        return has_room

    def leave(self, connection: "GuardedProtocol") -> None:
        """Remove a closed connection."""
        neighbours = self._of_peer[connection.peer]
        neighbours.remove(connection)
        self._n_open -= 1
        if not neighbours:
            del self._of_peer[connection.peer]

    def sweep(self) -> None:
        """Close all connections that have exceeded a deadline, or the limit of unsent bytes."""
        now_s = self.now_s()
        stalled_s = max(0.0, now_s - self._swept_s - MAX_PAUSE_S)
        self._swept_s = now_s
        for connection in self.all():
            connection.extend_deadlines(stalled_s)
            connection.check(now_s)
        self._relieve()

    def abort_all(self) -> None:
        """Abort all connections without sending the remaining bytes."""
        for connection in self.all():
            connection.abort()

    def all(self) -> set["GuardedProtocol"]:
        """Return the open connections."""
        return set().union(*self._of_peer.values())

    def _relieve(self) -> None:
        unsent = {each: n for each in self.all() if (n := each.n_unsent())}
        total = sum(unsent.values())
        for each in sorted(unsent, key=unsent.__getitem__, reverse=True):
            if total <= MAX_UNSENT_BYTES:
                return
            total -= unsent[each]
            each.abort()


def _make_room(connections: set["GuardedProtocol"]) -> bool:
    """Close the connection that has been idle longest; return False if none is idle.

    Connections that never sent a request are closed first.
    """
    waiting = [(since, each) for each in connections if (since := each.waiting_since())]
    if not waiting:
        return False
    _, longest = min(waiting, key=lambda pair: pair[0])
    longest.close_idle()
    return True


STOP_S = 2
"""Time after the start of a shutdown at which uvicorn cancels the remaining requests, s."""


class GuardedConfig(uvicorn.Config):
    """Configuration of uvicorn, which holds the middleware and the open connections.

    Parameters
    ----------
    hosts
        Accepted host names and addresses, in addition to loopback.
    now_s
        Function that returns the monotonic time for deadlines, s.
    """

    def __init__(
        self,
        app: ASGIApp,
        limits: HttpLimitSettings,
        hosts: Iterable[str],
        now_s: Callable[[], float],
        **options: Any,
    ) -> None:
        self.answers = BoundedAnswers(app, limits)
        super().__init__(
            cast(
                Any, guarded(self.answers, limits, hosts)
            ),  # Starlette and uvicorn declare different types
            http="service.api.http.protocol:GuardedProtocol",
            ws="none",
            log_level="warning",
            access_log=False,
            server_header=False,
            lifespan="off",
            proxy_headers=False,  # uvicorn would trust every local client
            timeout_keep_alive=round(limits.keep_alive_s),
            timeout_graceful_shutdown=STOP_S,
            **options,
        )
        self.connections = Connections(limits, now_s)


MAX_PIPELINED = 8
"""Maximum number of pipelined requests on a connection; browsers do not use pipelining."""

FRAMING_BYTES = 256 * 1024
"""Maximum number of bytes of a chunked body on the wire, in addition to 8 per byte of data."""

PROGRESS_BYTES = 48 * 1024
"""Minimum number of bytes of an answer that a client must read within ``unsent_s``."""


class Phase(Enum):
    """Part of a request that the client is expected to send next."""

    HEAD = auto()
    BODY = auto()
    NOTHING = auto()


class GuardedProtocol(HttpToolsProtocol):
    """HTTP/1.1 connection of uvicorn with deadlines and size limits."""

    def __init__(
        self,
        config: GuardedConfig,
        server_state: ServerState,
        app_state: dict[str, Any],
        _loop: asyncio.AbstractEventLoop | None = None,
    ) -> None:
        super().__init__(config, server_state, app_state, _loop)
        self.peer = ""
        self._all, self._limits = config.connections, config.connections.limits
        self._phase, self._since_s = Phase.HEAD, self._all.now_s()
        self._unsent_since_s: float | None = None
        self._n_head = self._n_wire = self._n_body = self._n_unsent = 0
        self._refusal: Refusal = NOT_HTTP
        self._has_sent_request = self._ignores_input = False
        self._running: RequestResponseCycle | None = None

    # callbacks of the transport

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Add the connection to the open connections; answer 503 and close it above a limit."""
        super().connection_made(transport)
        self.peer = self.client[0] if self.client else ""
        if not self._all.admit(self):
            self._end(FULL)

    def connection_lost(self, exc: Exception | None) -> None:
        """Remove the connection from the open connections."""
        super().connection_lost(exc)
        self._ignores_input = True
        self._drop_answers()
        self._all.leave(self)

    def data_received(self, data: bytes) -> None:
        """Parse received bytes; a malformed or oversized request ends the connection."""
        self._unset_keepalive_if_required()
        if self._ignores_input:
            return
        try:
            self.parser.feed_data(data)
        except httptools.HttpParserUpgrade:
            self._answer_and_close()  # no other protocol is supported
        except httptools.HttpParserError:
            self._refuse()
        else:
            self._n_wire += len(data)  # may include the end of the previous request
            self._check_sizes()

    def resume_writing(self) -> None:
        """Reset the deadline for unsent bytes, and resume sending."""
        super().resume_writing()
        self._unsent_since_s = None

    # callbacks of the parser; feed_data raises HttpParserError for their exceptions

    def on_message_begin(self) -> None:
        """Reset the deadline and byte counts for a new request."""
        super().on_message_begin()
        if self._phase is not Phase.HEAD:
            self._enter(Phase.HEAD)
        self._n_head = self._n_wire = self._n_body = 0
        self._refusal = NOT_HTTP

    def on_url(self, url: bytes) -> None:
        """Append a part of the request target; raise ValueError above the maximum length."""
        super().on_url(url)
        if len(self.url) > 1024 * self._limits.max_target_kb:
            self._stop(TARGET_TOO_LONG)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Append a header; raise ValueError above the maximum total size, or for a trailer."""
        if self._phase is Phase.BODY:
            self._stop(NOT_HTTP)  # trailers are not supported
        super().on_header(name, value)
        self._n_head += len(name) + len(value) + 4
        if self._n_head > 1024 * self._limits.max_head_kb:
            self._stop(HEAD_TOO_LARGE)

    def on_headers_complete(self) -> None:
        """Start the application for the request, or queue a pipelined request."""
        if len(self.pipeline) >= MAX_PIPELINED:
            self._stop(NOT_HTTP)
        if not self.url.startswith(b"/"):
            self._stop(NOT_HTTP)  # an absolute target contains a second host name
        super().on_headers_complete()
        self._enter(Phase.BODY)

    def on_body(self, body: bytes) -> None:
        """Append a part of the body; `WholeBodies` limits its size."""
        self._n_body += len(body)
        super().on_body(body)

    def on_message_complete(self) -> None:
        """Record that the request has been received completely."""
        super().on_message_complete()
        self._has_sent_request = True
        self._enter(Phase.NOTHING)

    def on_response_complete(self) -> None:
        """Start the keep-alive time after an answer, even if the client has not read it yet."""
        super().on_response_complete()
        self._unsent_since_s = None
        if self._phase is Phase.NOTHING:
            self._enter(Phase.NOTHING)

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: ASGI3Application) -> None:
        self._running = cycle
        super()._start_asgi_task(cycle, app)

    # called by the server

    def check(self, now_s: float) -> None:
        """Close the connection if a deadline has passed."""
        if self._is_stuck(now_s):
            self.abort()
        elif self.transport.is_closing():
            pass  # already closing
        elif self.flow.read_paused and self._phase is not Phase.NOTHING:
            self._since_s = now_s  # the server has paused reading
        elif now_s - self._since_s > self._time_limit_s():
            self._end(TOO_SLOW if self._phase is not Phase.NOTHING and self._n_wire else None)

    def extend_deadlines(self, seconds: float) -> None:
        """Extend the deadlines by the time for which the server was stalled, s."""
        self._since_s += seconds
        if self._unsent_since_s is not None:
            self._unsent_since_s += seconds

    def waiting_since(self) -> tuple[bool, float] | None:
        """Return whether any request was received, and the start of the idle time; None if busy."""
        is_answered = self._phase is Phase.NOTHING and self._is_answering()
        if is_answered or self.transport.is_closing():
            return None
        return self._has_sent_request, self._since_s

    def n_unsent(self) -> int:
        """Return the number of bytes in the write buffer."""
        return self.transport.get_write_buffer_size()

    def close_idle(self) -> None:
        """Close this idle connection to make room for a new connection."""
        self._end(None)

    def abort(self) -> None:
        """Abort the connection without sending the remaining bytes."""
        self._ignores_input = True
        self._drop_answers()
        self.transport.abort()

    def shutdown(self) -> None:
        """Close the connection after pending answers; an incomplete request is not answered."""
        if self._phase is Phase.BODY:
            self._end(None)
        else:
            super().shutdown()

    # internals

    def _enter(self, phase: Phase) -> None:
        self._phase, self._since_s = phase, self._all.now_s()

    def _time_limit_s(self) -> float:
        if self._phase is Phase.HEAD:
            return self._limits.head_s
        if self._phase is Phase.BODY:
            return self._limits.body_s
        return float("inf") if self._is_answering() else self._limits.keep_alive_s

    def _is_answering(self) -> bool:
        return self.cycle is not None and not self.cycle.response_complete

    def _is_stuck(self, now_s: float) -> bool:
        n_unsent = self.n_unsent()
        if not n_unsent:
            self._unsent_since_s = None
            return False
        if self._unsent_since_s is None or n_unsent <= self._n_unsent - PROGRESS_BYTES:
            self._unsent_since_s, self._n_unsent = now_s, n_unsent
        return now_s - self._unsent_since_s > self._limits.unsent_s

    def _stop(self, refusal: Refusal) -> None:
        self._refusal = refusal
        raise ValueError(refusal.title)

    def _check_sizes(self) -> None:
        """End the connection if the head or the chunk framing of a request is too long."""
        if self._phase is Phase.HEAD and self._n_wire > 1024 * (
            self._limits.max_head_kb + self._limits.max_target_kb
        ):
            self._end(HEAD_TOO_LARGE)
        elif self._phase is Phase.BODY and self._n_wire > FRAMING_BYTES + 8 * self._n_body:
            self._end(NOT_HTTP)

    def _refuse(self) -> None:
        """Refuse a malformed request; while an answer is pending, only close after the answer."""
        if self._phase is Phase.HEAD and self._is_answering():
            self._answer_and_close()
        else:
            self._end(self._refusal)

    def _answer_and_close(self) -> None:
        self._ignores_input = True
        if self._is_answering():
            self.cycle.keep_alive = False
        else:
            self.transport.close()

    def _end(self, refusal: Refusal | None) -> None:
        """Close the connection; send the refusal first, if given and if an answer is possible."""
        self._ignores_input = True
        if refusal is not None and self._may_answer():
            self.transport.write(refusal.as_http(SECURITY_HEADERS))
        self._drop_answers()
        self.transport.close()

    def _drop_answers(self) -> None:
        """Mark all unfinished requests as disconnected; uvicorn marks only the newest request."""
        waiting = [cycle for cycle, _ in self.pipeline]
        self.pipeline.clear()
        for cycle in (self._running, self.cycle, *waiting):
            if cycle is not None and not cycle.response_complete:
                cycle.disconnected = True
                cycle.message_event.set()

    def _may_answer(self) -> bool:
        """Whether the server may write the next answer on this connection."""
        if self.transport.is_closing():
            return False
        if self._phase is Phase.BODY:
            return not (self.cycle.response_started or self.pipeline)
        return not self._is_answering()
