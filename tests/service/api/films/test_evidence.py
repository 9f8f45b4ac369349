"""Evidence of a film that has changed: document, page, bundle, whatever people write."""

import io
import json
import zipfile
from html.parser import HTMLParser
from importlib.metadata import version
from typing import Any

import pyarrow.parquet as pq
import pytest
from harness.waiting import at_work, until

from core.alarms.alarm import Alarm, AlarmIdentity, AlarmNews, AlarmRule
from core.alarms.judgements import film_judgement
from core.alarms.life_cycle import update
from core.alarms.operation import Acknowledge, operate
from core.change.film_judge import alarm_condition
from core.limits import NEVER_JUDGED
from service.api.auth.authenticator import Authenticator
from service.store.access.identities import Role

ALARM = "U1:UJB:film_stiffness"
PATH = f"/api/v1/alarms/{ALARM}/evidence"
HOSTILE = '<script>alert("1")</script><img src=x onerror=alert(2)>'


def raised(service: Any, machine: Any) -> AlarmNews:
    """A film that has lost a third raises its alarm."""
    machine.run(30, ln_change=-0.4)
    told = service.films.newest("U1", "UJB")
    found = {axis: alarm_condition(told.findings, axis) for axis in "xy"}
    condition = film_judgement(found, NEVER_JUDGED)
    assert condition.level is not None
    alarm = Alarm(AlarmIdentity("U1", "UJB", "film_stiffness"))
    news = AlarmNews(*update(alarm, condition, machine.time_ns, AlarmRule()))
    service.evidence.see([news])
    service.store.append([], [], [news])
    return news


class Tags(HTMLParser):
    """Collects what a browser would do."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.words = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}

    def handle_data(self, data: str) -> None:
        self.words += data


async def test_the_evidence_of_a_changed_film(service, machine):
    """Its document, its page and its bundle; one service, because the film takes long to change."""
    news = raised(service, machine)
    async with at_work(service.evidence.run()):
        await until(lambda: service.evidence.n_written)
    await service.evidence.close()

    await require_a_document_of_what_the_film_was_compared_with(service)
    await require_a_report_of_everything_without_a_script(service)
    await require_a_bundle_of_everything(service)
    await require_that_a_key_of_one_unit_gets_nothing_of_the_others(service)
    await require_that_what_people_write_stays_writing(service, news, machine.time_ns)


async def require_a_document_of_what_the_film_was_compared_with(service: Any) -> None:
    [listed] = (await service.json(PATH))["occurrences"]
    assert (listed["state"], listed["samples"], listed["change"]) == ("complete", "none", "raised")
    found = await service.json(listed["evidence"])
    assert found["alarm"]["id"] == ALARM
    compared = found["comparisons"][0]
    assert compared["direction"] == "x"
    assert compared["baseline"]["version"] == 1
    assert compared["cell"]["support"] in ("own", "borrowed")
    (low, high), (cold, warm) = compared["bounds"][:2]
    assert low <= compared["eccentricity_ratio"] < high
    assert cold <= compared["oil_temperature_c"] < warm
    assert compared["stiffness"] / compared["expected_stiffness"] == pytest.approx(0.67, abs=0.01)
    members = compared["members"]
    assert members["n_in_all"] == len(members["time"]) == len(members["stiffness"]) > 0
    assert all(low <= e < high for e in members["eccentricity_ratio"])
    assert [scale["time_scale_h"] for scale in compared["time_scales"]]
    finding = found["bearings"][0]["film"]["findings"][0]
    assert finding["level"] in ("alert", "danger")
    assert finding["change_percent"] < -10.0
    assert found["limits"]["films"]["change"]["alert_change"] == 0.035


async def require_a_report_of_everything_without_a_script(service: Any) -> None:
    answer = await service.get(f"{PATH}/1/report")

    assert answer.status_code == 200
    assert answer.headers["content-type"] == "text/html; charset=utf-8"
    assert "default-src 'none'" in answer.headers["content-security-policy"]
    page = Tags(answer.text)
    assert 'href="/#/alarms"' in answer.text
    assert not page.tags & {"script", "img", "iframe", "link", "object", "form"}
    assert not {name for name in page.attributes if name.startswith("on")}
    for words in (
        "film stiffness changed, x and y",
        "under this condition: in x now −",
        "; in y now −",
        "confirmed −",
        "95 %:",
        "GN/m",
        "configuration ",
        "baseline version 1",
    ):
        assert words in page.words, words
    assert answer.text.count("<svg") >= 3


async def require_that_what_people_write_stays_writing(
    service: Any, news: AlarmNews, time_ns: int
) -> None:
    action = Acknowledge(actor=HOSTILE, comment=HOSTILE, occurrence=1)
    told = AlarmNews(*operate(news.alarm, action, time_ns + 1))
    service.store.append([], [], [told])

    page = Tags((await service.get(f"{PATH}/1/report")).text)

    assert "script" not in page.tags
    assert "img" not in page.tags
    assert "<script>" in page.words


async def require_a_bundle_of_everything(service: Any) -> None:
    answer = await service.get(f"{PATH}/1/bundle.zip")

    assert answer.headers["content-type"] == "application/zip"
    assert "attachment" in answer.headers["content-disposition"]
    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        assert archive.testzip() is None
        names = set(archive.namelist())
        assert names >= {
            *("README.txt", "report.html", "evidence.json", "spectra.parquet", "trend.parquet"),
            "configuration.json",
        }
        document = json.loads(archive.read("evidence.json"))
        trend = pq.read_table(io.BytesIO(archive.read("trend.parquet")))
    assert document["alarm"]["id"] == ALARM
    assert trend.num_rows > 30
    assert trend["level_x"].to_pylist()[-1] > 0


async def require_that_a_key_of_one_unit_gets_nothing_of_the_others(service: Any) -> None:
    create_key = Authenticator(service.access, service.clock).create_key
    _, key = create_key("historian", Role.VIEWER, ["U1"], 1)
    headers = {"Authorization": f"Bearer {key}"}
    answer = await service.client.get(f"{PATH}/1/bundle.zip", headers=headers)

    with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
        contents = {name: archive.read(name) for name in archive.namelist()}
    assert not [name for name, content in contents.items() if b'"U2"' in content]
    made_by = json.loads(contents["evidence.json"])["made_by"]
    assert made_by == f"padwatch {version('padwatch')}"  # not who runs it, and where


async def test_what_is_not_there_is_a_problem(learned):
    for path, status in (
        (f"{PATH}/1", 404),
        ("/api/v1/alarms/U1:UJB:nonsense/evidence", 404),
        ("/api/v1/alarms/..:..:film_stiffness/evidence", 404),
        ("/api/v1/alarms/..%2f..:x:film_stiffness/evidence/1", 404),
        (f"{PATH}/0", 422),
    ):
        await learned.problem(path, status)
    await learned.problem(PATH, 422, limit=0)


async def test_evidence_that_waits_for_the_disk_is_not_called_lost(service, machine):
    raised(service, machine)

    [listed] = (await service.json(PATH))["occurrences"]
    assert (listed["state"], listed["evidence"]) == ("waiting", None)
    await service.problem(f"{PATH}/1/report", 409)
