"""What Prometheus is told by a running service."""

from typing import Any

from prometheus_client.openmetrics.parser import text_string_to_metric_families

from core.account import SampleAccount


async def test_counts_agree_with_the_account_of_samples(
    running: Any, account: SampleAccount, numbers: Any
) -> None:
    families = await running.metrics()

    def of(name: str, **labels: str) -> float:
        found = numbers(families, f"padwatch_samples_{name}_total")
        return float(found[frozenset({"unit": "U1", **labels}.items())])

    rejected = {reason: of("rejected", reason=reason) for reason in account.rejected}
    assert of("received", quality="good") == account.n_stored
    assert of("received", quality="flagged") == account.n_flagged
    assert of("missing") == account.n_gap
    assert rejected == account.rejected
    assert of("offered") == account.n_offered
    assert of("offered") == sum(
        number
        for name in ("received", "missing", "rejected")
        for labels, number in numbers(families, f"padwatch_samples_{name}_total").items()
        if ("unit", "U1") in labels
    )


async def test_a_device_that_does_not_answer_is_told_without_numbers_that_nobody_knows(
    running: Any,
) -> None:
    assert await running.value("padwatch_link_connected", unit="U1") == 1.0
    assert await running.value("padwatch_link_connected", unit="U2") == 0.0
    for name in ("ingest_lag_seconds", "data_age_seconds"):
        assert await running.value(f"padwatch_{name}", unit="U1") is not None
        assert await running.value(f"padwatch_{name}", unit="U2") is None
    lag_s = await running.value("padwatch_ingest_lag_seconds", unit="U1")
    assert -3600.0 < lag_s < 3600.0  # seconds, of samples that were made just now
    assert await running.value("padwatch_bearings", unit="U2", quality="bad") == 3.0
    assert await running.value("padwatch_samples_offered_total", unit="U2") == 0.0


async def test_every_result_every_poll_and_every_commit_is_timed_once(running: Any) -> None:
    await running.until("padwatch_store_commit_duration_seconds_count", lambda n: n > 0.0)

    # segments of 8192 samples every 7168: the first after the missing block is the only one
    assert await running.value("padwatch_assessment_duration_seconds_count", unit="U1") == 6.0
    assert await running.value("padwatch_assessment_duration_seconds_count", unit="U2") == 0.0
    # 19 blocks with a wait after each: what came before the first wait has no beginning
    assert await running.value("padwatch_poll_duration_seconds_count", unit="U1") == 18.0
    assert await running.value("padwatch_poll_duration_seconds_count", unit="U2") == 0.0


async def test_the_format_is_the_one_that_is_asked_for(running: Any) -> None:
    plain = await running.client.get("/metrics")
    assert plain.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"

    accept = "application/openmetrics-text;version=1.0.0,text/plain;version=0.0.4;q=0.5"
    asked = await running.client.get("/metrics", headers={"accept": accept})
    expected = "application/openmetrics-text; version=1.0.0; charset=utf-8"
    assert asked.headers["content-type"] == expected
    assert asked.text.endswith("# EOF\n")
    names = {family.name for family in text_string_to_metric_families(asked.text)}
    assert names == set(await running.metrics())


async def test_a_strange_accept_header_is_no_fault_and_not_repeated(running: Any) -> None:
    accept = "text/plain;version=x.y;escaping=<b>, application/openmetrics-text;version=zzz"

    answer = await running.client.get("/metrics", headers={"accept": accept})

    assert answer.status_code == 200
    assert "zzz" not in str(answer.headers)


async def test_metrics_are_described_with_the_api(running: Any) -> None:
    document = (await running.client.get("/api/v1/openapi.json")).json()

    operation = document["paths"]["/metrics"]["get"]
    assert operation["summary"]
    assert set(operation["responses"]["200"]["content"]) == {
        "text/plain",
        "application/openmetrics-text",
    }
    assert (await running.client.get("/api/v1/metrics")).status_code == 404


async def test_an_outbox_that_cannot_be_read_is_a_metric_and_no_failed_scrape(
    running: Any,
) -> None:
    assert await running.value("padwatch_outbox_readable") == 1.0
    database = running.folder / "padwatch.sqlite3"
    database.rename(running.folder / "elsewhere")

    assert await running.value("padwatch_outbox_readable") == 0.0
    assert (
        await running.value("padwatch_delivery_waiting_messages", receiver="control-room") is None
    )
    (running.folder / "elsewhere").rename(database)
