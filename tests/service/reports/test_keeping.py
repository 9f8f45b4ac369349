"""Every occurrence of an alarm leaves its evidence and samples, or it is said that it did not."""

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from acquisition.recordings.manifest import MANIFEST
from core.alarms.alarm import AlarmEvent
from core.baseline.history import ReadingOutcome
from core.change.decision import INITIAL_DECISION, Verdict
from core.change.film_judge import FilmNews, unjudged
from core.change.film_reading import FilmReading, FilmValue
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel
from core.machine.unit import Estimator
from core.quality import Reading, Reason
from service.recordings.around_alarms import Outcome
from service.recordings.folders import ALARM
from service.recordings.segment import write_alarms
from service.reports import collector as module
from service.reports.archive import DamagedEvidenceError
from service.reports.collector import SnapshotTaker
from service.reports.document import Evidence
from service.reports.folders import INCOMPLETE, place_of

NOBODY: frozenset[tuple[str, int]] = frozenset()
SHAFT = "U1:UJB:order1_shaft_x"
CAPTURE = "U1-20260101T000000.000Z-x"


def document(folder: Path) -> Evidence:
    return Evidence.model_validate_json((folder / "evidence.json").read_bytes())


def states(rig: Any, alarm: str = SHAFT) -> list[tuple[int, str]]:
    found = rig.archive.occurrences(alarm, rig.keeper.pending, 100)
    return [(each.event.occurrence, each.state.value) for each in found]


def recorded(folder: Path, event: AlarmEvent) -> Path:
    """What a finished capture leaves, as far as links go."""
    folder.mkdir(parents=True)
    (folder / MANIFEST).write_text("{}")
    write_alarms(folder / ALARM, [event])
    return folder


def samples(rig: Any, capturing: frozenset[tuple[str, int]] = NOBODY) -> str:
    [found] = rig.archive.occurrences(SHAFT, NOBODY, 9)
    return str(rig.archive.samples(found, capturing).value)


class Expecting(SnapshotTaker):
    """A service that keeps the samples around alarms."""

    def take(self, event: AlarmEvent, now_ns: int, samples_expected: bool) -> Any:
        return replace(super().take(event, now_ns, samples_expected), samples_expected=True)


class Moved(SnapshotTaker):
    """A service with a film whose damping over stiffness in y has changed most."""

    def take(self, event: AlarmEvent, now_ns: int, samples_expected: bool) -> Any:
        found = super().take(event, now_ns, samples_expected)
        said = [replace(each, limit=0.1) for each in unjudged(Verdict.NORMAL)]
        said[-1] = replace(said[-1], level=AlarmLevel.ALERT, change=0.2)
        value = FilmValue(20.0, 0.01, 40.0, 5.0, ReadingOutcome.MEASURED, Reason.OK)
        steady = BearingCondition(OperatingState.FULL_LOAD, is_settled=True, cell=(7, 18))
        place = ("U1", "UJB", Estimator.DYNAMIC, now_ns, steady, 90.9, 30.0, 0.4, 0.01, 45.0, 46.0)
        film = FilmReading(*place, (value, value))
        news = FilmNews(film, tuple(said), (INITIAL_DECISION,) * len(said))
        ujb = replace(found.bearings["UJB"], film=news)
        return replace(found, bearings={**found.bearings, "UJB": ujb})


async def test_evidence_of_a_film_whose_damping_changed_names_its_direction(rig, news):
    rig.keeper._taker = Moved({u.id: u for u in rig.plant.unit}, rig.live, rig.films)
    await rig.write(news(kind="film_stiffness"))
    assert document(rig.bundles[0]).direction == "y"


async def test_an_alarm_leaves_a_bundle_that_says_what_was_known(rig, news):
    await rig.write(news(12.5))

    [folder] = rig.bundles
    assert folder.parent.name == "U1"
    assert folder.name == "20260101T000012.500Z-UJB-order1_shaft_x-1"
    found = document(folder)
    assert (found.alarm.value, found.alarm.limit, found.alarm.change) == (160.0, 150.0, "raised")
    assert (found.bearing, found.direction, found.unit.link) == ("UJB", "x", "connected")  # type: ignore[union-attr]
    assert [each.bearing for each in found.bearings] == ["UJB", "LJB"]
    assert found.bearings[0].readings["order1_shaft_x_um_pk"].value == 160.0
    assert {each.estimator for each in found.bearings[0].estimators} == {
        *("dynamic", "transfer_order1", "transfer_vortex", "ratio_order1", "ratio_vortex")
    }
    assert found.missing == ["bearing TJB had no result yet"]
    assert set(found.files) == {"spectra.parquet"}
    assert states(rig) == [(1, "complete")]
    stored = rig.folders.configurations / f"{found.configuration}.json"
    assert json.loads(stored.read_bytes())["settings"]["unit"][0]["id"] == "U1"


async def test_what_comes_after_an_alarm_does_not_change_its_evidence(rig, news, assessment):
    rig.raise_(news())
    rig.live.set_assessment(assessment(order1_shaft_x_um_pk=Reading(20.0)))
    async with rig.running():
        await rig.written(1)

    reading = document(rig.bundles[0]).bearings[0].readings["order1_shaft_x_um_pk"]
    assert reading.value == 160.0


async def test_the_service_itself_and_lost_links_have_evidence_too(rig, news):
    await rig.write(
        news(kind="link_lost", subject="link", unit="U2"),
        news(kind="results_lost", subject="store", unit="plant"),
    )

    link, own = (document(folder) for folder in rig.bundles)
    assert link.unit is not None
    assert (link.unit.link, link.bearing, link.bearings) == ("connecting", None, [])
    assert own.unit is None


async def test_a_bundle_that_somebody_has_changed_is_no_evidence(rig, news):
    await rig.write(news())
    [found] = rig.archive.occurrences(SHAFT, NOBODY, 9)
    path = rig.bundles[0] / "evidence.json"
    assert rig.archive.document(found.place).alarm.value == 160.0

    path.write_text(path.read_text().replace('"value": 160.0', '"value": 140.0'))
    with pytest.raises(DamagedEvidenceError, match="changed since it was written"):
        rig.archive.document(found.place)


async def test_a_full_disk_delays_evidence_and_loses_none(rig, news):
    raised = news()
    folder = place_of(rig.folders.evidence, raised.events[0]).folder
    aside = folder.with_name(folder.name + INCOMPLETE)
    aside.mkdir(parents=True)
    (aside / "spectra.parquet").symlink_to("/dev/full")  # every write to it finds no space

    assert rig.keeper.error is None
    rig.raise_(raised)
    await rig.keeper._write_one()
    assert "No space left on device" in rig.keeper.error
    assert (rig.keeper.n_failed, rig.keeper.n_pending, rig.bundles) == (1, 1, [])
    assert states(rig) == [(1, "waiting")]

    async with rig.running():
        await rig.written(1)
    assert (rig.keeper.error, states(rig)) == (None, [(1, "complete")])


async def test_a_disk_that_refuses_is_tried_again_until_it_does_not(rig, news):
    rig.folders.evidence.parent.mkdir(parents=True)
    rig.folders.evidence.write_text("in the way")
    async with rig.running():
        rig.raise_(news())
        await rig.until(lambda: rig.keeper.n_failed > 5)
        assert states(rig) == [(1, "waiting")]
        rig.folders.evidence.unlink()
        await rig.written(1)

    assert states(rig) == [(1, "complete")]


async def test_evidence_that_a_crash_has_cut_short_is_said_to_be_lost(rig_of, rig, news):
    await rig.write(news(1.0))
    cut = news(2.0, occurrence=2)
    rig.store.append([], [], [cut])  # the service is killed while it writes
    left = place_of(rig.folders.evidence, cut.events[0]).folder
    left = left.with_name(left.name + INCOMPLETE)
    left.mkdir()
    (left / "evidence.json").write_text("{")

    again = await rig_of()
    async with again.running():
        await again.until(lambda: not left.exists())

    assert states(again) == [(2, "lost"), (1, "complete")]


async def test_an_alarm_from_before_evidence_was_kept_has_not_lost_any(rig, news):
    rig.store.append([], [], [news(-3600.0)])
    await rig.write(news(0.0, occurrence=2))

    assert states(rig) == [(2, "complete"), (1, "not_kept")]


async def test_a_disk_that_stays_away_takes_no_more_memory_than_is_allowed(rig, news, monkeypatch):
    monkeypatch.setattr(module, "MAX_PENDING", 3)
    for number in range(1, 6):
        rig.raise_(news(float(number), occurrence=number))

    assert (rig.keeper.n_pending, rig.keeper.n_lost) == (3, 2)
    await rig.keeper.close()
    assert [number for number, state in states(rig) if state == "complete"] == [5, 4, 3]


async def test_old_evidence_makes_room_and_a_chattering_alarm_only_for_itself(rig_of, news, plant):
    evidence = plant.evidence.model_copy(update={"max_per_alarm": 3})
    rig = await rig_of(plant.model_copy(update={"evidence": evidence}))
    async with rig.running():
        rig.raise_(news(0.0, "order1_shaft_y"))
        for number in range(1, 6):
            rig.raise_(news(float(number), occurrence=number))
        await rig.until(lambda: len(rig.bundles) == 4 and rig.keeper.n_written == 6)

    assert states(rig) == [
        *((5, "complete"), (4, "complete"), (3, "complete")),
        *((2, "removed"), (1, "removed")),
    ]
    assert states(rig, "U1:UJB:order1_shaft_y") == [(1, "complete")]


async def test_a_finished_capture_is_linked_with_its_hash(rig, news):
    raised = news()
    capture = recorded(rig.folders.captures / CAPTURE, raised.events[0])
    async with rig.running():
        rig.raise_(raised)
        rig.keeper.captured(Outcome(raised.events, capture))
        found = await rig.linked()

    assert (rig.bundles[0] / found.folder).resolve() == capture.resolve()
    assert found.manifest.size == 2
    assert samples(rig) == "complete"
    shutil.rmtree(capture)
    assert samples(rig) == "removed"


async def test_samples_that_could_not_be_kept_are_said_to_be_lost(rig, news):
    raised = news()
    async with rig.running():
        rig.raise_(raised)
        rig.keeper.captured(Outcome(raised.events, None, "the disk is too slow for them"))
        found = await rig.linked()

    assert (found.state, found.reason) == ("lost", "the disk is too slow for them")
    assert samples(rig) == "lost"


async def test_a_capture_finished_just_before_a_crash_is_linked_after_it(rig_of, rig, news):
    raised = news()
    await rig.write(raised)
    assert samples(rig) == "none"  # this service has not kept any
    recorded(rig.folders.captures / CAPTURE, raised.events[0])

    again = await rig_of()
    async with again.running():
        await again.linked()
    assert samples(again) == "complete"


async def test_samples_that_were_expected_and_never_came_are_lost(rig, news):
    rig.keeper._taker = Expecting({u.id: u for u in rig.plant.unit}, rig.live, rig.films)
    await rig.write(news())

    assert samples(rig, frozenset({(SHAFT, 1)})) == "being_made"
    assert samples(rig) == "lost"
