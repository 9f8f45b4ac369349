"""Configuration of the HTTP server, with what its connections share."""

from collections.abc import Callable, Iterable
from typing import Any, cast

import uvicorn
from starlette.types import ASGIApp

from service.api.http.answers import BoundedAnswers
from service.api.http.connections import Connections
from service.api.http.guard import guarded
from service.settings.processes import HttpLimitSettings

STOP_S = 2
"""When uvicorn gives up what the server has not given up before, which logs a traceback."""


class GuardedConfig(uvicorn.Config):
    """Uvicorn's configuration, the open connections and the answers that are worked on.

    Parameters
    ----------
    hosts
        Names by which the service may be asked for, besides those of loopback and the settings.
    now_s
        Steady time in seconds, for the deadlines.
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
            ),  # Starlette and uvicorn name its type apart
            http="service.api.http.protocol:GuardedProtocol",
            ws="none",
            log_level="warning",
            access_log=False,
            server_header=False,
            lifespan="off",
            proxy_headers=False,  # uvicorn would believe everybody on this computer
            timeout_keep_alive=round(limits.keep_alive_s),
            timeout_graceful_shutdown=STOP_S,
            **options,
        )
        self.connections = Connections(limits, now_s)
