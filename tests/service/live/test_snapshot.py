"""Snapshots of units as documents in a database: whole and of this version, or refused."""

import zlib
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import version

import pytest

from core.alarms.alarm import Alarm, AlarmIdentity
from core.baseline.history import ReadingOutcome
from core.change.decision import INITIAL_DECISION, Verdict
from core.change.film_judge import FilmNews, unjudged
from core.change.film_reading import FilmReading, FilmValue
from core.condition.cells import BearingCondition
from core.condition.operating_state import OperatingState
from core.limits import AlarmLevel
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.quality import Reading, Reason
from service.live import snapshot
from service.live.snapshot import (
    UnitSnapshot,
    UnreadableError,
    snapshot_document,
    snapshot_of_document,
)
from service.measuring.snapshots import bearing_snapshot

IDENTITY = AlarmIdentity("U1", "UJB", "order1_shaft_x")
FOUND = unjudged(Verdict.NO_BASELINE)
VALUE = FilmValue(20.0, 0.01, 40.0, 5.0, ReadingOutcome.MEASURED, Reason.OK)
STEADY = BearingCondition(OperatingState.FULL_LOAD, is_settled=True, cell=(7, 18))
READ = FilmReading(
    *("U1", "UJB", Estimator.DYNAMIC, 1, STEADY, 90.9, 30.0, 0.4, 0.01, 45.0, 46.0, (VALUE, VALUE))
)


@pytest.fixture
def published(assessment: Callable[..., Assessment]) -> UnitSnapshot:
    """A unit with a film, an active alarm, and a result in which one value is NaN."""
    found = assessment()
    readings = {**found.readings, "power_mw": Reading(float("nan"))}
    alarm = Alarm(IDENTITY, level=AlarmLevel.DANGER, occurrence=3, is_acknowledged=False)
    return UnitSnapshot(
        bearings={"UJB": bearing_snapshot(replace(found, readings=readings))},
        alarms=(alarm,),
        judged=frozenset({IDENTITY.id}),
        chattering=frozenset(),
        films={"UJB": FilmNews(READ, FOUND, (INITIAL_DECISION,) * len(FOUND))},
        baselines={"UJB": 2},
    )


def test_a_snapshot_is_read_as_it_was_written(published):
    read = snapshot_of_document(snapshot_document(published))

    assert repr(read) == repr(published)  # NaN is not equal to itself
    assert read.alarms == published.alarms


def test_a_snapshot_of_another_version_is_refused_with_both_named(published):
    _, _, content = snapshot_document(published).partition(b"\n")

    with pytest.raises(UnreadableError) as refused:
        snapshot_of_document(b"0.0.1\n" + content)

    assert "written by padwatch 0.0.1" in str(refused.value)
    assert f"this is padwatch {version('padwatch')}" in str(refused.value)


def test_a_damaged_snapshot_is_refused_or_read_as_it_was(published):
    document = snapshot_document(published)
    refused = 0
    for at in range(0, len(document), 7):
        damaged = bytearray(document)
        damaged[at] ^= 0x10
        try:
            assert repr(snapshot_of_document(bytes(damaged))) == repr(published)
        except UnreadableError:
            refused += 1
    for stop in range(0, len(document), 50):
        with pytest.raises(UnreadableError):
            snapshot_of_document(document[:stop])

    assert refused > 0.9 * len(document) / 7


def test_a_snapshot_that_unpacks_to_too_much_is_refused(monkeypatch):
    monkeypatch.setattr(snapshot, "MAX_BYTES", 1000)
    with pytest.raises(UnreadableError, match="longer than 1000 bytes"):
        snapshot_of_document(snapshot.OWN_VERSION + zlib.compress(b"0" * 1001))
