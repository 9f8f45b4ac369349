"""What a serving process shows is as old as its samples, not as the report on it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigs.blocks import given_block

from core.quality import GOOD, Reason
from core.samples.gaps import SampleAccount
from service.live.current_state import SILENT_AFTER_S, LiveUnits
from service.live.snapshot import UnitLink, link_document, link_of_document
from service.live.status import LinkState, UnitStatus
from service.measuring.live_view import LiveView
from service.measuring.snapshots import bearing_snapshot
from service.settings.plant import load_plant_file

STALE_AFTER_S = 30.0
UNIT = load_plant_file(Path(__file__).parents[3] / "deploy" / "demo.toml").unit[0]
BEARING = UNIT.bearing[0].id
BLOCK = given_block(UNIT.id, 1, 0, 0, 600.0, np.zeros((1, 60), dtype=np.float32), (GOOD,), {})


@pytest.mark.parametrize(("behind_s", "is_current"), [(0.0, True), (29.0, True), (31.0, False)])
def test_what_has_waited_for_the_analysis_is_as_old_in_the_serving_process(
    stepped_clock, assessment, behind_s, is_current
):
    live = LiveView([UNIT.id], stepped_clock, STALE_AFTER_S)
    replica = LiveUnits([UNIT.id], stepped_clock, STALE_AFTER_S)
    found = replace(assessment(), unit=UNIT.id, bearing=BEARING)
    live.set_link(UNIT.id, LinkState.CONNECTED)
    replica.update(UNIT.id, "one", 1, live.link(UNIT.id))

    sampled_s = stepped_clock.monotonic_s() - behind_s
    live.set_received(BLOCK, SampleAccount(), sampled_s)
    live.set_assessment(found, sampled_s)
    replica.set_results(UNIT.id, {BEARING: bearing_snapshot(found)})
    replica.update(UNIT.id, "one", 2, link_of_document(link_document(live.link(UNIT.id))))

    shown = replica.current(UNIT.id, BEARING)
    assert shown.is_current is is_current
    assert shown.age_s == pytest.approx(behind_s)
    assert replica.data_age_s(UNIT.id) == pytest.approx(behind_s)
    assert replica.why_no_samples(UNIT.id) is (None if is_current else Reason.STALE)


@pytest.fixture
def replica(stepped_clock: Any) -> LiveUnits:
    """One that has been told once of a unit whose samples arrive."""
    made = LiveUnits([UNIT.id], stepped_clock, STALE_AFTER_S)
    made.update(UNIT.id, "one", 1, signs(0.0, stepped_clock.monotonic_s()))
    return made


def signs(data_age_s: float, said_s: float) -> UnitLink:
    """What somebody has said of the unit, on a steady clock that began an hour before."""
    status = UnitStatus(LinkState.CONNECTED)
    return UnitLink(status, data_age_s, {BEARING: data_age_s}, said_s + 3600.0)


@pytest.mark.parametrize("held_up_s", [0.0, 4.0, 40.0])
def test_a_report_that_the_database_has_kept_back_makes_nothing_younger(
    stepped_clock, replica, held_up_s
):
    stepped_clock.step(1.0)
    said_s = stepped_clock.monotonic_s()
    stepped_clock.step(held_up_s)
    replica.update(UNIT.id, "one", 2, signs(0.2, said_s))

    assert replica.data_age_s(UNIT.id) == pytest.approx(0.2 + held_up_s, abs=0.1)
    assert replica.is_alive(UNIT.id) is (held_up_s < SILENT_AFTER_S)


def test_another_process_is_believed_from_its_second_report_on(stepped_clock, replica):
    said_s = stepped_clock.monotonic_s()
    stepped_clock.step(3.0)  # kept back, of which nobody can know yet
    replica.update(UNIT.id, "two", 1, signs(0.2, said_s))
    assert replica.data_age_s(UNIT.id) is None
    assert replica.why_no_samples(UNIT.id) is Reason.NOT_CONNECTED

    replica.update(UNIT.id, "two", 2, signs(0.3, stepped_clock.monotonic_s()))
    assert replica.data_age_s(UNIT.id) == pytest.approx(0.3)
    assert replica.why_no_samples(UNIT.id) is None
