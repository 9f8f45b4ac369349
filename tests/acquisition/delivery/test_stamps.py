"""The sample index rules; stamps that do not fit it are told, not believed."""

import numpy as np
import pytest

from acquisition.delivery.arrival import HostStamps
from acquisition.delivery.blocks import RawBlock, StampCheck, sample_block
from core.samples.blocks import SampleBlock, StampFault
from core.samples.calibration import UNLIMITED, UnitCalibration

NS = 1_000_000_000
START_NS = 1_767_225_600 * NS
RATE_HZ = 600.0


def block(index: int, off_s: float = 0.0, epoch: int = 1) -> SampleBlock:
    """A second of samples whose stamp is off by so much."""
    stamp_ns = START_NS + index * NS + round(off_s * NS)
    counts = np.zeros((1, 600), dtype=np.int16)
    raw = RawBlock(epoch, 600 * index, stamp_ns, 600.0, counts, (True,), ())
    return sample_block([raw], UnitCalibration("U1", 600.0, (UNLIMITED,), ()))


def test_stamps_that_fit_are_kept_to_the_nanosecond_and_a_restart_may_have_any_time() -> None:
    check = StampCheck()
    for n, off_s in enumerate((0.0, 0.5, -0.3, 0.123456789)):
        checked, fault = check.check(block(n, off_s))
        assert fault is None
        assert checked.start_ns == block(n, off_s).start_ns
    assert check.check(block(0, -86400.0, epoch=2))[1] is None


@pytest.mark.parametrize(
    ("off_s", "fault"),
    [
        (-1.0, StampFault.REPEATED),
        (-5.0, StampFault.REGRESSED),
        (-3e9, StampFault.REGRESSED),
        (5.0, StampFault.JUMPED),
        (2.5e9, StampFault.JUMPED),
    ],
    ids=["repeat", "back", "1904", "ahead", "2106"],
)
def test_a_single_wrong_stamp_is_replaced_by_what_the_index_says(off_s, fault) -> None:
    check = StampCheck()
    check.check(block(0))
    checked, found = check.check(block(1, off_s))
    assert found is fault
    assert checked.start_ns == block(1).start_ns
    assert check.check(block(2))[1] is None
    assert check.n_faults == 1


def test_a_clock_that_was_set_is_believed_from_the_second_stamp_on() -> None:
    check = StampCheck()
    check.check(block(0))
    assert check.check(block(1, 3600.0))[1] is StampFault.JUMPED
    checked, fault = check.check(block(2, 3600.0))
    assert fault is None
    assert checked.start_ns == block(2, 3600.0).start_ns


@pytest.mark.parametrize("off_s", [-3.8e9, -1.767e9, 2.5e9], ids=["1904", "1970", "2106"])
def test_a_clock_that_has_left_all_possible_years_is_never_believed(off_s: float) -> None:
    check = StampCheck()
    check.check(block(0))
    for n in range(1, 10):
        checked, fault = check.check(block(n, off_s))
        assert fault is not None
        assert checked.start_ns == block(n).start_ns
    checked, fault = check.check(block(10, 0.25))
    assert fault is None
    assert checked.start_ns == block(10, 0.25).start_ns


def test_a_clock_that_began_in_1970_may_be_set_and_drift() -> None:
    check = StampCheck()
    assert check.check(block(0, -1.767e9))[1] is None
    assert check.check(block(1, -1.767e9 + 100.0))[1] is StampFault.JUMPED
    assert check.check(block(2, -1.767e9 + 100.0))[1] is None
    assert check.check(block(3))[1] is StampFault.JUMPED
    assert check.check(block(4))[1] is None


def arrivals(
    duration_s: float, drift: float = 0.0, jitter_s: float = 0.0, first_late_s: float = 0.0
):
    """Stop index and arrival of blocks of 50; the device runs faster by the drift."""
    random = np.random.default_rng(20261121)
    for n in range(1, int(duration_s * RATE_HZ / 50)):
        late_s = first_late_s if n == 1 else random.exponential(jitter_s) if jitter_s else 0.0
        at_s = n * 50 / RATE_HZ * (1.0 - drift) + late_s
        yield n * 50, START_NS + round(at_s * NS)


def test_stamps_follow_the_nominal_rate_however_the_blocks_trickle_in():
    stamps = HostStamps(RATE_HZ)
    starts = []
    for stop, arrived_ns in arrivals(9.0, jitter_s=0.05):
        stamps.add(0, stop, arrived_ns)
        starts.append(stamps.start_ns(stop - 50))
    np.testing.assert_allclose(np.diff(starts), 50 / RATE_HZ * NS, atol=1.0)


@pytest.mark.parametrize("drift", [-150e-6, 0.0, 20e-6, 150e-6])
def test_stamps_stay_with_the_host_for_hours_though_the_device_drifts(drift):
    stamps = HostStamps(RATE_HZ)
    previous = 0
    for stop, arrived_ns in arrivals(7200.0, drift, jitter_s=0.005, first_late_s=0.3):
        stamps.add(0, stop, arrived_ns)
        start = stamps.start_ns(stop - 50)
        assert previous == 0 or abs(start - previous - 50 / RATE_HZ * NS) < 601e-6 * 50e9 / 600
        previous = start
    true_ns = START_NS + round((stop - 50) / RATE_HZ * (1.0 - drift) * NS)
    assert abs(start - true_ns) < 3_000_000


def test_one_late_block_moves_nothing():
    stamps, undisturbed = HostStamps(RATE_HZ), HostStamps(RATE_HZ)
    for stop, arrived_ns in arrivals(60.0):
        stamps.add(0, stop, arrived_ns + (5 * NS if stop == 20_000 else 0))
        undisturbed.add(0, stop, arrived_ns)
        assert stamps.start_ns(stop) == undisturbed.start_ns(stop)


@pytest.mark.parametrize("step_s", [-7200, 7200])
def test_a_host_clock_that_was_set_is_followed_at_once_or_after_ten_seconds(step_s):
    stamps = HostStamps(RATE_HZ)
    for stop, arrived_ns in arrivals(40.0):
        stepped_ns = arrived_ns + (step_s * NS if stop > 6000 else 0)
        stamps.add(0, stop, stepped_ns)
    assert abs(stamps.start_ns(stop) - stepped_ns) < 1_000_000


def test_a_gap_in_the_index_takes_the_time_it_took_and_a_new_epoch_begins_a_new_line():
    stamps = HostStamps(RATE_HZ)
    stamps.add(0, 600, START_NS)
    stamps.add(0, 600 + 600 * 3600, START_NS + 3600 * NS)
    assert stamps.start_ns(600 + 600 * 3600) == START_NS + 3600 * NS
    stamps.add(1, 50, START_NS + 7200 * NS)
    assert stamps.start_ns(50) == START_NS + 7200 * NS
