"""Prometheus metrics of a process: families that are filled at a scrape, and their text."""

from collections.abc import Iterable, Mapping
from importlib.metadata import version
from platform import python_version

from prometheus_client import CONTENT_TYPE_PLAIN_0_0_4, CollectorRegistry, disable_created_metrics
from prometheus_client.exposition import generate_latest
from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

# the start time of the process is a metric of its own
disable_created_metrics()  # type: ignore[no-untyped-call]

TEXT = CONTENT_TYPE_PLAIN_0_0_4
"""Media type of the text of `Families`."""

MEASURED = CollectorRegistry()
"""Histograms of the measuring process, each beside the code that it measures."""

PROGRAM = {
    "build_info": "This is 1; the labels are the versions of padwatch and of Python.",
    "store_info": "This is 1; the label is the kind of the database.",
}


class Families(Collector):
    """Metric families that are filled from the state of the program at a scrape."""

    def __init__(self) -> None:
        self._families: dict[str, Metric] = {}

    def declare(self, meanings: Mapping[str, str]) -> None:
        """Declare families: help text by name without ``padwatch_``; ``_total`` marks counters."""
        for name, meaning in meanings.items():
            family = CounterMetricFamily if name.endswith("_total") else GaugeMetricFamily
            self._families[name] = family(f"padwatch_{name}", meaning)

    def add(self, name: str, value: float | None, **labels: str) -> None:
        """Add a sample to a declared family; a value of None (unknown) adds no sample."""
        if value is not None:
            self._families[name].add_sample(f"padwatch_{name}", labels, float(value))

    def include(self, metric: Collector, **labels: str) -> None:
        """Add the samples of a `prometheus_client` metric, with `labels` besides its own."""
        for found in metric.collect():
            family = self._families.setdefault(
                found.name, Metric(found.name, found.documentation, found.type)
            )
            family.samples += [
                sample._replace(labels=labels | dict(sample.labels)) for sample in found.samples
            ]

    def add_program(self, store_kind: str) -> None:
        """Add the versions of padwatch and Python, and the kind of the database."""
        self.declare(PROGRAM)
        self.add("build_info", 1, version=version("padwatch"), python=python_version())
        self.add("store_info", 1, kind=store_kind)

    def collect(self) -> Iterable[Metric]:
        """Return all declared families, including families without samples."""
        return self._families.values()

    @property
    def text(self) -> bytes:
        """Text of all families in the Prometheus text format 0.0.4."""
        return generate_latest(self)
