"""Requests refused while the service cannot keep up, so that samples and alarms come first."""

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
"""Share of its limit below which the load must stay for `RELIEF_S` before requests are accepted."""

RELIEF_S = 5.0


class Refused(IntEnum):
    """Refused requests; a higher level includes the lower ones."""

    NOTHING = 0
    HISTORY = 1
    VIEWS = 2


MAX_DELAY_S, MAX_WAITING_SHARE, MAX_LAG_S = 2.0, 0.2, 1.0
"""Waiting time of the oldest block, fill level of the queue to the analysis, and lasting delay of
the event loop above which requests for past values are refused; at twice these, live values too.

In between, continuous recording stops (`service.recordings.continuous_recorder`)."""


@dataclass(frozen=True)
class RefusalState:
    """Level of refusal.

    Parameters
    ----------
    relieved_s
        Monotonic time since when a lower level suffices; None if it does not.
    """

    refused: Refused = Refused.NOTHING
    relieved_s: float | None = None


def advance(state: RefusalState, over: float, now_s: float) -> RefusalState:
    """Update the level of refusal: raise it at once, lower it after `RELIEF_S`."""
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
"""Number of successive checks over the limit that make an overload."""


WORDS = {
    Refused.HISTORY: "requests for past values",
    Refused.VIEWS: "requests for past and live values",
}


class LoadWatch:
    """Watches the queue and the event loop, and counts refused requests.

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
        """Level of refusal now."""
        return self._state.refused

    @property
    def words(self) -> str | None:
        """Refused requests in words; None if none are."""
        return WORDS.get(self.refused)

    @property
    def lag_s(self) -> float:
        """Smallest delay of the event loop within the last second."""
        return min(self._lags)

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Check periodically."""
        while True:
            pulse.beat(CHECK_PERIOD_S)
            due_s = self._clock.monotonic_s() + CHECK_PERIOD_S
            await self._clock.sleep(CHECK_PERIOD_S)
            self.look(self._clock.monotonic_s() - due_s)

    def look(self, late_s: float) -> None:
        """Check once.

        Parameters
        ----------
        late_s
            Delay of the event loop.
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
        """Whether a request of this kind is refused now; count it if so."""
        if refused_from is Refused.NOTHING or refused_from > self.refused:
            return False
        self.n_refused[refused_from] += 1
        return True


VITAL = re.compile(
    r"/(livez|readyz|metrics)"
    r"|/api/v1/alarms(/[^/]+)?"  # the list, and one of it
    r"|/api/v1/session"
    r"|/(?!api/).*"  # the pages, which show the alarms
)
"""Paths that are never refused; neither are requests that change something."""

VIEWS = re.compile(
    r"/api/v1/overview"
    r"|/api/v1/sources"
    r"|/api/v1/units(/[^/]+(/channels)?)?"
    r"|/api/v1/units/[^/]+/bearings(/[^/]+(/latest|/orbit|/budgets/[^/]+)?)?"
)
"""Paths of live values, answered from memory."""

READING = ("GET", "HEAD")


def refused_from(method: str, path: str) -> Refused:
    """Return the level of load that refuses a request; `Refused.NOTHING` for none."""
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
    """ASGI middleware that refuses requests while the service cannot keep up."""

    def __init__(self, app: ASGIApp, load: LoadWatch) -> None:
        self._app, self._load = app, load

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse a request or forward it."""
        if scope["type"] == "http" and self._load.refuses(
            refused_from(scope["method"], scope["path"])
        ):
            await OVERLOADED.send(scope, send)
            return
        await self._app(scope, receive, send)


KINDS = (Refused.HISTORY, Refused.VIEWS)


def load_metrics(load: LoadWatch | None) -> Iterator[Metric]:
    """Yield metrics of refused requests; none without a load watch."""
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
    """Token bucket.

    Parameters
    ----------
    n_at_once
        Size of the bucket.
    seconds_each
        Time in which one token is added, s.
    now_s
        Monotonic time, s.
    """

    def __init__(self, n_at_once: int, seconds_each: float, now_s: float) -> None:
        self._n_at_once, self._seconds_each = float(n_at_once), seconds_each
        self._n_free, self._seen_s = self._n_at_once, now_s

    def take(self, now_s: float) -> bool:
        """Take a token; return whether there was one."""
        self._n_free += (now_s - self._seen_s) / self._seconds_each
        self._n_free, self._seen_s = min(self._n_free, self._n_at_once), now_s
        if self._n_free < 1.0:
            return False
        self._n_free -= 1.0
        return True
