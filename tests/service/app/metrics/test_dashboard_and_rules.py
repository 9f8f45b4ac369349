"""The Grafana dashboard and the alert rules ask only for what a running service tells."""

import json
import re
from collections.abc import Iterable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
import yaml
from prometheus_client.metrics_core import Metric

from core.change.decision import Verdict
from core.change.film_judge import FilmFinding, FilmNews
from service.app.replica_process import REPORTS
from service.cluster.consumer import add_consumer
from service.live.metrics import add_films, add_units
from service.measuring.live_view import LiveView
from service.runtime.metrics import Families

DEPLOY = Path(__file__).parents[4] / "deploy"
DASHBOARD = json.loads((DEPLOY / "grafana" / "padwatch.json").read_text("utf-8"))
GROUPS = yaml.safe_load((DEPLOY / "prometheus" / "padwatch-rules.yml").read_text("utf-8"))
RULES = [rule for group in GROUPS["groups"] for rule in group["rules"]]

TARGET = {"job", "instance"}
"""Labels that Prometheus itself puts on everything it has asked for."""

GROUPING = re.compile(r"\bby ?\(([\w, ]*)\)")
MATCHER = re.compile(r'(\w+)(=~|!~|!=|=)"([^"]*)"')

Exposed = dict[str, tuple[str, set[frozenset[tuple[str, str]]]]]
"""Type and sets of labels, by the name of a sample."""


def check(expr: str, exposed: Exposed) -> tuple[set[str], set[str]]:
    """Compare an expression with what is told; return its metrics and the labels of its result."""
    names = set(re.findall(r"\b(?:padwatch|process)_\w+|\bup\b", expr))
    assert names <= set(exposed), f"{expr}: not all of {names} are exposed"
    label_sets = [labels for name in names for labels in exposed[name][1]]
    known = TARGET | {label for labels in label_sets for label, _ in labels}
    for name in names:
        is_rated = re.search(rf"\b(?:rate|increase)\({name}\b.*?\[", expr) is not None
        assert is_rated == (exposed[name][0] == "counter"), f"{expr}: {name}"
    for label, operator, value in MATCHER.findall(expr):
        assert label in known, f"{expr}: label {label}"
        if operator == "=" and not value.startswith("$") and label not in TARGET:
            assert any((label, value) in labels for labels in label_sets), f"{label}={value}"
    kept = {label for labels in GROUPING.findall(expr) for label in re.findall(r"\w+", labels)}
    assert kept <= known, f"{expr}: a label that nothing has"
    return names, kept or known


def of_several_processes(live: LiveView) -> Iterable[Metric]:
    """What `padwatch serve` and `padwatch analyse` tell besides, and films that are judged."""
    families = Families()
    finding = FilmFinding(Verdict.NORMAL, change=0.01)
    news = FilmNews(Mock(), (finding, finding), ())
    add_units(families, live, {"U1": ["UJB"]})
    add_films(families, live, lambda *_: news, {"U1": ["UJB"]})
    families.declare(REPORTS)
    families.add("unit_analysed", 1, unit="U1")
    unit = SimpleNamespace(behind_s=0.5, refused={}, n_repeated=0)
    add_consumer(families, Mock(trouble=None, n_pending={"U1": 3}, units={"U1": unit}))
    return families.collect()


@pytest.fixture
def exposed(told: Any, live: LiveView) -> Exposed:
    """All that a running service tells, once its results are on the disk, and what others do."""
    found: Exposed = {"up": ("gauge", {frozenset()})}  # by Prometheus itself
    for family in (*told.plain.families.values(), *of_several_processes(live)):
        for sample in family.samples:
            is_gauge = family.type == "gauge"
            _, sets = found.setdefault(sample.name, ("gauge" if is_gauge else "counter", set()))
            sets.add(frozenset(sample.labels.items()))
    return found


def test_the_dashboard_asks_only_for_what_is_told(exposed):
    asked = set()
    for panel in DASHBOARD["panels"]:
        for target in panel.get("targets", ()):
            names, labels = check(target["expr"], exposed)
            asked |= names
            legend = set(re.findall(r"\{\{(\w+)\}\}", target["legendFormat"]))
            assert legend <= labels, f"{panel['title']}: {target['legendFormat']}"
    own = {name.removesuffix("_bucket") for name in asked if name.startswith("padwatch_")}
    assert len(own) > 30


def test_choices_of_the_dashboard_are_labels_that_are_told(exposed):
    choices = {choice["name"]: choice for choice in DASHBOARD["templating"]["list"]}
    for name, choice in choices.items():
        if choice["type"] == "query":
            found = re.fullmatch(r"label_values\((.+), (\w+)\)", choice["definition"])
            assert found is not None, name
            _, labels = check(found[1], exposed)
            assert found[2] in labels
    used = set(re.findall(r"\$\{?(\w+)", json.dumps(DASHBOARD["panels"])))
    assert used - {"__rate_interval"} == set(choices)


def test_the_dashboard_fits_together():
    panels = DASHBOARD["panels"]

    assert len({panel["id"] for panel in panels}) == len(panels)
    taken: set[tuple[int, int]] = set()
    for panel in panels:
        at = panel["gridPos"]
        cells = {(at["x"] + x, at["y"] + y) for x in range(at["w"]) for y in range(at["h"])}
        assert at["x"] + at["w"] <= 24
        assert not cells & taken, panel["title"]
        taken |= cells
        assert panel["title"]
        assert panel["type"] == "row" or panel["description"].endswith(".")


def test_alert_rules_ask_only_for_what_is_told(exposed):
    assert set(GROUPS) == {"groups"}
    assert len({rule["alert"] for rule in RULES}) == len(RULES)
    for rule in RULES:
        _, labels = check(rule["expr"], exposed)
        assert set(rule) <= {"alert", "expr", "for", "labels", "annotations"}
        assert re.fullmatch(r"Padwatch[A-Za-z]+", rule["alert"])
        assert re.fullmatch(r"\d+m", rule.get("for", "1m"))
        assert rule["labels"]["severity"] in ("warning", "critical")
        assert set(rule["annotations"]) == {"summary", "description"}
        words = " ".join(rule["annotations"].values())
        assert set(re.findall(r"\$labels\.(\w+)", words)) <= labels, rule["alert"]


def test_a_link_without_results_is_an_alert(exposed):
    [silent] = [rule for rule in RULES if rule["alert"] == "PadwatchSilentHealthy"]

    names, _ = check(silent["expr"], exposed)

    by_name = {name: exposed[name][1] for name in names}
    connected = by_name["padwatch_link_connected"]
    results = by_name["padwatch_assessment_duration_seconds_count"]
    # sides of `and` meet where all labels agree: from the start on, for every unit
    assert connected == results == {frozenset({("unit", unit)}) for unit in ("U1", "U2")}


WRONG = (
    "padwatch_link_conected",
    'padwatch_link_connected{station="U1"}',
    'padwatch_alarms_active{priority="high"}',
    "sum by (bearing) (padwatch_link_connected)",
    "padwatch_samples_missing_total",
    "rate(padwatch_queue_blocks[5m])",
)


def test_a_wrong_expression_is_noticed(exposed):
    for expr in WRONG:
        with pytest.raises(AssertionError):
            check(expr, exposed)
