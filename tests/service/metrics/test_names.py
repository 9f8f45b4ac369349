"""Names by Prometheus' rules, and labels that cannot grow without bound."""

import re
from pathlib import Path
from typing import Any

LABELS = {
    *("volume", "about", "kind"),
    *("unit", "bearing", "quality", "priority", "verdict", "reason", "receiver"),
    *("version", "python", "le"),
}

BASE_UNITS = ("_seconds", "_bytes")

NOT_BASE_UNITS = (
    *("milliseconds", "ms", "us", "ns", "minutes", "hours", "days", "percent", "kilobytes"),
    *("mb", "celsius_milli", "rpm"),
)


def test_names_follow_the_rules_of_prometheus(told: Any) -> None:
    families = [f for f in told.plain.families.values() if f.name.startswith("padwatch_")]

    assert len(families) > 30
    for family in families:
        words = family.name.split("_")
        assert re.fullmatch(r"[a-z][a-z0-9_]*", family.name), family.name  # a colon is for rules
        assert not set(words) & set(NOT_BASE_UNITS), family.name
        assert words[-1] not in ("total", "count", "sum", "bucket"), family.name
        assert family.documentation.endswith("."), family.name
        assert family.type in ("counter", "gauge", "histogram"), family.name
        if family.type == "counter":
            assert all(sample.name == f"{family.name}_total" for sample in family.samples)
        if family.type == "histogram" or {
            "lag",
            "age",
            "wait",
            "behind",
            "offset",
            "duration",
        } & set(words):
            assert family.name.endswith(BASE_UNITS), family.name


def test_labels_are_few_and_their_values_are_words_of_the_plant_or_of_padwatch(
    told: Any,
) -> None:
    for family in told.plain.families.values():
        for sample in family.samples:
            assert set(sample.labels) <= LABELS, sample
            for label, value in sample.labels.items():
                assert re.fullmatch(r"[A-Za-z0-9_.+-]{1,60}", value), sample
                assert label not in family.name.split("_"), f"{family.name} repeats {label}"


def test_histograms_rise_and_end_with_all(told: Any) -> None:
    for family in told.plain.families.values():
        if family.type != "histogram":
            continue
        by_unit: dict[str, list[float]] = {}
        for sample in family.samples:
            unit = sample.labels.get("unit", "")
            if sample.name.endswith("_bucket"):
                by_unit.setdefault(unit, []).append(sample.value)
            if sample.name.endswith("_count"):
                assert by_unit[unit][-1] == sample.value
        for counts in by_unit.values():
            assert counts == sorted(counts)


def test_the_guide_names_all_that_is_told_and_nothing_else(told: Any) -> None:
    guide = (Path(__file__).parents[3] / "docs" / "how-to" / "metrics.md").read_text("utf-8")
    table = guide[guide.index("## What there is") : guide.index("## Grafana")]

    told = {
        family.name + ("_total" if family.type == "counter" else "")
        for family in told.plain.families.values()
        if family.name.startswith("padwatch_")
    }
    assert set(re.findall(r"`(padwatch_\w+)`", table)) == told
