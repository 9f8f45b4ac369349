"""Load shedding: refusal of requests under overload, so that samples and alarms have priority."""

import re
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import IntEnum

import structlog
from prometheus_client.metrics_core import Metric
from starlette.types import ASGIApp, Receive, Scope, Send

from acquisition.clock import Clock
from service.api.http.refusals import Refusal
from service.measuring.acquirer import Bus
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.metrics import counter, gauge

RELIEF_SHARE = 0.5
"""Fraction of the limit of a level; the load must stay below it for `RELIEF_S` to end the level."""

RELIEF_S = 5.0


class Refused(IntEnum):
    """Level of refusal: no requests, requests for past values, or also for live values."""

    NOTHING = 0
    HISTORY = 1
    VIEWS = 2


MAX_DELAY_S, MAX_WAITING_SHARE, MAX_LAG_S = 2.0, 0.2, 1.0
"""Limits of the load: waiting time of the oldest block in the queue to the analysis, s; fraction of
this queue in use; delay of the event loop, s. At a limit, requests for past values are refused; at
twice a limit, also requests for live values.

Between these levels, continuous recording stops (`service.recordings.continuous_recorder`)."""


@dataclass(frozen=True)
class RefusalState:
    """State of the load shedding.

    Parameters
    ----------
    refused
        Level of refusal in force.
    relieved_s
        Monotonic time since which a lower level is sufficient, s; None if it is not sufficient.
    """

    refused: Refused = Refused.NOTHING
    relieved_s: float | None = None


def advance(state: RefusalState, over: float, now_s: float) -> RefusalState:
    """Return the next state: the level rises at once, and falls by one after `RELIEF_S`.

    Parameters
    ----------
    over
        Load divided by its limit.
    now_s
        Monotonic time, s.
    """
    wanted = Refused(min(int(over), Refused.VIEWS))
    if wanted >= state.refused or over > RELIEF_SHARE * state.refused:
        return RefusalState(max(wanted, state.refused))
    if state.relieved_s is None:
        return replace(state, relieved_s=now_s)
    is_over = now_s - state.relieved_s >= RELIEF_S
    return RefusalState(Refused(state.refused - 1)) if is_over else state


log = structlog.get_logger()

CHECK_PERIOD_S = 0.25

N_CHECKS = 4
"""Number of consecutive checks above a limit that are required for overload."""


WORDS = {
    Refused.HISTORY: "requests for past values",
    Refused.VIEWS: "requests for past and live values",
}


class LoadWatch:
    """Load monitor of analysis queue and event loop, which sets the level of refusal.

    Parameters
    ----------
    bus
        Queue of blocks to the analysis.
    """

    def __init__(self, bus: Bus, clock: Clock) -> None:
        self._bus, self._clock = bus, clock
        self._lags = deque([0.0] * N_CHECKS, N_CHECKS)
        self._overs = deque([0.0] * N_CHECKS, N_CHECKS)
        self._state = RefusalState()
        self.n_refused: Counter[Refused] = Counter()

    @property
    def refused(self) -> Refused:
        """Current level of refusal."""
        return self._state.refused

    @property
    def words(self) -> str | None:
        """Description of the refused requests; None if no requests are refused."""
        return WORDS.get(self.refused)

    @property
    def lag_s(self) -> float:
        """Smallest delay of the event loop within the last second, s."""
        return min(self._lags)

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Check the load every `CHECK_PERIOD_S` until cancelled."""
        while True:
            pulse.beat(CHECK_PERIOD_S)
            due_s = self._clock.monotonic_s() + CHECK_PERIOD_S
            await self._clock.sleep(CHECK_PERIOD_S)
            self.look(self._clock.monotonic_s() - due_s)

    def look(self, late_s: float) -> None:
        """Check the load once; update the level of refusal and log its changes.

        Parameters
        ----------
        late_s
            Delay of the event loop since the last check, s.
        """
        self._lags.append(max(0.0, late_s))
        delay_s, waiting_share = self._bus.oldest_wait_s, self._bus.depth / self._bus.capacity
        ratios = delay_s / MAX_DELAY_S, waiting_share / MAX_WAITING_SHARE, self.lag_s / MAX_LAG_S
        self._overs.append(max(ratios))
        before = self.refused
        self._state = advance(self._state, min(self._overs), self._clock.monotonic_s())
        if self.refused != before:
            write = log.warning if self.refused else log.info
            write(
                "requests are refused" if self.refused else "requests are accepted again",
                refused=self.refused.name.lower(),
                delay_s=round(delay_s, 2),
                waiting_share=round(waiting_share, 2),
                lag_s=round(self.lag_s, 2),
            )

    def refuses(self, refused_from: Refused) -> bool:
        """Whether requests that are refused from a level are refused now; refusals are counted."""
        if refused_from is Refused.NOTHING or refused_from > self.refused:
            return False
        self.n_refused[refused_from] += 1
        return True


VITAL = re.compile(
    r"/(livez|readyz|metrics)"
    r"|/api/v1/alarms(/[^/]+)?"  # the alarm list, and one alarm
    r"|/api/v1/session"
    r"|/(?!api/).*"  # the pages, which show the alarms
)
"""Pattern of paths that are never refused; requests that change state are not refused either."""

VIEWS = re.compile(
    r"/api/v1/overview"
    r"|/api/v1/sources"
    r"|/api/v1/units(/[^/]+(/channels)?)?"
    r"|/api/v1/units/[^/]+/bearings(/[^/]+(/latest|/orbit|/budgets/[^/]+)?)?"
)
"""Pattern of paths with live values, which are answered from memory."""

READING = ("GET", "HEAD")


def refused_from(method: str, path: str) -> Refused:
    """Return the lowest level at which a request is refused; `Refused.NOTHING` if it never is."""
    if method not in READING or (VITAL.fullmatch(path) and path != "/api/v1/alarms/rates"):
        return Refused.NOTHING
    return Refused.VIEWS if VIEWS.fullmatch(path) else Refused.HISTORY


OVERLOADED = Refusal(
    503,
    "Too busy",
    "the service is overloaded and analyses samples first; try again later",
    retry_after_s=10,
)


class LoadShedder:
    """ASGI middleware that refuses requests while the service is overloaded."""

    def __init__(self, app: ASGIApp, load: LoadWatch) -> None:
        self._app, self._load = app, load

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Forward a request, or refuse it with status 503 under overload."""
        if scope["type"] == "http" and self._load.refuses(
            refused_from(scope["method"], scope["path"])
        ):
            await OVERLOADED.send(scope, send)
            return
        await self._app(scope, receive, send)


KINDS = (Refused.HISTORY, Refused.VIEWS)


def load_metrics(load: LoadWatch | None) -> Iterator[Metric]:
    """Yield metrics of refused requests and of the event loop; nothing if `load` is None."""
    if load is None:
        return
    yield counter(
        "questions_refused",
        "Requests rejected with 503 because the service was overloaded.",
        ("about",),
        [((kind.name.lower(),), load.n_refused[kind]) for kind in KINDS],
    )
    yield gauge(
        "refusing",
        "1 while such requests are rejected.",
        ("about",),
        [((kind.name.lower(),), load.refused >= kind) for kind in KINDS],
    )
    yield gauge(
        "event_loop_lag_seconds",
        "Smallest delay of the event loop within the last second.",
        (),
        [((), load.lag_s)],
    )


class TokenBucket:
    """Token bucket for a rate limit.

    Parameters
    ----------
    n_at_once
        Capacity of the bucket, tokens; the bucket is full at the start.
    seconds_each
        Time after which a token is added, s.
    now_s
        Monotonic time of the start, s.
    """

    def __init__(self, n_at_once: int, seconds_each: float, now_s: float) -> None:
        self._n_at_once, self._seconds_each = float(n_at_once), seconds_each
        self._n_free, self._seen_s = self._n_at_once, now_s

    def take(self, now_s: float) -> bool:
        """Take a token; return whether one was available at the monotonic time `now_s`."""
        self._n_free += (now_s - self._seen_s) / self._seconds_each
        self._n_free, self._seen_s = min(self._n_free, self._n_at_once), now_s
        if self._n_free < 1.0:
            return False
        self._n_free -= 1.0
        return True
