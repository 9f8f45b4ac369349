"""Metrics of what is given up while the service cannot keep up."""

from collections.abc import Iterator

from prometheus_client.metrics_core import Metric

from service.api.load.strain import Refused
from service.api.load.watch import LoadWatch
from service.runtime.metrics import counter, gauge

KINDS = (Refused.HISTORY, Refused.VIEWS)


def load_metrics(load: LoadWatch | None) -> Iterator[Metric]:
    """Questions that were not answered; none where nobody looks at the load."""
    if load is None:
        return
    yield counter(
        "questions_refused",
        "Questions answered by 503 because the service was behind.",
        ("about",),
        [((kind.name.lower(),), load.n_refused[kind]) for kind in KINDS],
    )
    yield gauge(
        "refusing",
        "1 while such questions are refused.",
        ("about",),
        [((kind.name.lower(),), load.refused >= kind) for kind in KINDS],
    )
    yield gauge(
        "event_loop_lag_seconds",
        "By how much the program has been late at every look within the last second.",
        (),
        [((), load.lag_s)],
    )
