"""What Prometheus is told by a running service, under names and labels by its own rules."""

import re
from pathlib import Path

LABELS = {
    *("volume", "kind", "direction", "estimator", "place", "route", "status"),
    *("unit", "bearing", "quality", "priority", "verdict", "reason", "receiver"),
    *("version", "python", "le"),
}

TIMES = {"lag", "age", "wait", "behind", "offset", "duration"}
BASE_UNITS = ("_seconds", "_bytes")

NOT_BASE_UNITS = {
    *("milliseconds", "ms", "us", "ns", "minutes", "hours", "days", "percent", "kilobytes"),
    *("mb", "celsius_milli", "rpm"),
}


def test_counts_agree_with_the_account_of_samples(told, account):
    def of(name: str, **labels: str) -> float:
        found = told.plain.value(f"padwatch_samples_{name}_total", unit="U1", **labels)
        return float(found)

    rejected = {reason: of("rejected", reason=reason) for reason in account.rejected}
    assert of("received", quality="good") == account.n_stored
    assert of("received", quality="flagged") == account.n_flagged
    assert of("missing") == account.n_gap
    assert rejected == account.rejected
    assert of("offered") == account.n_offered
    assert of("offered") == sum(
        number
        for name in ("received", "missing", "rejected")
        for labels, number in told.plain.numbers(f"padwatch_samples_{name}_total").items()
        if ("unit", "U1") in labels
    )


def test_a_device_that_does_not_answer_has_no_numbers_that_nobody_knows(told):
    value = told.plain.value
    assert value("padwatch_link_connected", unit="U1") == 1.0
    assert value("padwatch_link_connected", unit="U2") == 0.0
    for name in ("ingest_lag_seconds", "data_age_seconds"):
        assert value(f"padwatch_{name}", unit="U1") is not None
        assert value(f"padwatch_{name}", unit="U2") is None
    assert value("padwatch_bearings", unit="U2", quality="bad") == 3.0
    assert value("padwatch_samples_offered_total", unit="U2") == 0.0


def test_every_result_every_poll_and_every_commit_is_timed_once(told):
    def count(name: str, **labels: str) -> float:
        return float(told.plain.value(f"padwatch_{name}_duration_seconds_count", **labels))

    # segments of 8192 samples every 7168: the first after the missing block is the only one
    assert count("assessment", unit="U1") == 6.0
    assert count("assessment", unit="U2") == 0.0
    # 19 blocks with a wait after each: what came before the first wait has no beginning
    assert count("poll", unit="U1") == 18.0
    assert count("poll", unit="U2") == 0.0
    assert count("store_commit") > 0.0


def test_frames_that_were_not_used_are_counted_and_polls_timed_by_both_ends(told):
    refused = told.plain.numbers("padwatch_frames_refused_total")
    assert refused == {frozenset({("unit", "U1"), ("reason", "duplicate")}): 2.0}
    first, second = told.sources
    assert (first["unit"], first["polls"]["n"]) == ("U1", 18)
    assert first["polls"]["newest_s"] > 0.0
    total_s = told.plain.value("padwatch_poll_duration_seconds_sum", unit="U1")
    assert abs(first["polls"]["mean_s"] - total_s / 18) < 1e-9
    assert first["refused_frames"] == {"duplicate": 2}
    assert (second["unit"], second["polls"], second["refused_frames"]) == ("U2", None, {})


def test_the_format_is_plain_text_whatever_is_accepted(told):
    for scrape in told.scrapes.values():
        assert scrape.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
        assert set(scrape.families) >= set(told.plain.families)


def test_requests_are_timed_by_route_and_status(told):
    name = "padwatch_http_request_duration_seconds_count"
    scrapes = [told.plain, told.scrapes["strange"], told.blind]
    counts = [scrape.value(name, route="/metrics", status="200") for scrape in scrapes]

    assert None not in counts
    assert counts == sorted(set(counts))  # an answer counts from the next one on
    assert told.blind.value("padwatch_serving_process_cpu_seconds_total") > 0.0


def test_an_outbox_that_cannot_be_read_is_a_metric_and_no_failed_scrape(told):
    waiting = "padwatch_delivery_waiting_messages"

    assert told.plain.value("padwatch_outbox_readable") == 1.0
    assert told.plain.value(waiting, receiver="control-room") is not None
    assert told.blind.value("padwatch_outbox_readable") == 0.0
    blind = [family for name, family in told.blind.families.items() if "padwatch_delivery" in name]
    assert [family.name for family in blind if family.samples] == []  # not even zeros


def test_names_follow_the_rules_of_prometheus(told):
    families = [f for f in told.plain.families.values() if f.name.startswith("padwatch_")]

    assert len(families) > 30
    for family in families:
        words = family.name.split("_")
        assert not set(words) & NOT_BASE_UNITS, family.name
        assert family.documentation.endswith("."), family.name
        if family.type == "histogram" or TIMES & set(words):
            assert family.name.endswith(BASE_UNITS), family.name


def test_labels_are_few_and_their_values_are_words_of_the_plant(told):
    for family in told.plain.families.values():
        for sample in family.samples:
            assert set(sample.labels) <= LABELS, sample
            for label, value in sample.labels.items():
                pattern = r"[A-Za-z0-9_.+-]{1,60}" if label != "route" else r"[a-z0-9_./{}-]{1,99}"
                assert re.fullmatch(pattern, value), sample
                assert label not in family.name.split("_"), f"{family.name} repeats {label}"


def test_the_guide_names_all_that_is_told_and_nothing_else(told):
    guide = (Path(__file__).parents[4] / "docs" / "how-to" / "metrics.md").read_text("utf-8")
    table = guide[guide.index("## List of metrics") : guide.index("## Grafana")]

    told = {
        family.name + ("_total" if family.type == "counter" else "")
        for family in told.plain.families.values()
        if family.name.startswith("padwatch_")
    }
    assert set(re.findall(r"`(padwatch_\w+)`", table)) == told
