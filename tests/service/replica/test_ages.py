"""What a replica shows is as old as its samples, not as the report on it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.clock import Clock
from core.account import SampleAccount
from core.assessment import Assessment
from core.blocks import SampleBlock
from core.quality import GOOD, Reason
from service.live import LinkState, LiveView
from service.replica.describing import bearing_state, unit_signs
from service.replica.live import ReplicaLive
from service.replica.unit_state import read_signs, written_signs
from service.settings.loading import load_plant_file

STALE_AFTER_S = 30.0
UNIT = load_plant_file(Path(__file__).parents[3] / "deploy" / "demo.toml").unit[0]
BEARING = UNIT.bearing[0].id
BLOCK = SampleBlock(UNIT.id, 1, 0, 0, 600.0, np.zeros((1, 60), dtype=np.float32), (GOOD,), {})


@pytest.mark.parametrize(("behind_s", "is_current"), [(0.0, True), (29.0, True), (31.0, False)])
def test_what_has_waited_for_the_analysis_is_as_old_in_a_replica(
    stepped_clock: Clock,
    assessment: Callable[..., Assessment],
    behind_s: float,
    is_current: bool,
) -> None:
    live = LiveView([UNIT.id], stepped_clock, STALE_AFTER_S)
    replica = ReplicaLive([UNIT.id], stepped_clock, STALE_AFTER_S)
    found = replace(assessment(), unit=UNIT.id, bearing=BEARING)
    live.set_link(UNIT.id, LinkState.CONNECTED)
    replica.hear(UNIT.id, "one", 1, unit_signs(UNIT, live))

    live.set_received(BLOCK, SampleAccount(), behind_s)
    live.set_assessment(found, behind_s)
    replica.set_results(UNIT.id, {BEARING: bearing_state(found)})
    replica.hear(UNIT.id, "one", 2, read_signs(written_signs(unit_signs(UNIT, live))))

    shown = replica.current(UNIT.id, BEARING)
    assert shown.is_current is is_current
    assert shown.age_s == pytest.approx(behind_s)
    assert replica.data_age_s(UNIT.id) == pytest.approx(behind_s)
    assert replica.why_no_samples(UNIT.id) is (None if is_current else Reason.STALE)
