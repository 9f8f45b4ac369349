"""What is shown as current is as old as its samples, wherever they have waited."""

import numpy as np
import pytest
from rigs.blocks import given_block

from core.quality import GOOD
from core.samples.gaps import SampleAccount
from service.live.status import LinkState
from service.measuring.live_view import LiveView

STALE_AFTER_S = 30.0
BLOCK = given_block("U1", 1, 0, 0, 600.0, np.zeros((1, 60), dtype=np.float32), (GOOD,))


@pytest.fixture
def live(stepped_clock) -> LiveView:
    live = LiveView(["U1"], stepped_clock, STALE_AFTER_S)
    live.set_link("U1", LinkState.CONNECTED)
    return live


@pytest.mark.parametrize(("behind_s", "is_current"), [(0.0, True), (29.0, True), (31.0, False)])
def test_a_result_of_samples_that_have_waited_too_long_is_not_current(
    live, stepped_clock, assessment, behind_s, is_current
):
    found = assessment()
    live.set_assessment(found, stepped_clock.monotonic_s() - behind_s)

    shown = live.current(found.unit, found.bearing)

    assert shown.is_current is is_current
    assert shown.age_s == pytest.approx(behind_s)


def test_samples_age_from_when_the_device_had_them_and_not_from_their_analysis(live, stepped_clock):
    live.set_received(BLOCK, SampleAccount(), stepped_clock.monotonic_s() - 31.0)

    assert live.data_age_s("U1") == pytest.approx(31.0)
