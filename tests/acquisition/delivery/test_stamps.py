"""Stamps that fit are kept, others replaced; the clock of a device against that of its host."""

from collections.abc import Callable

import numpy as np
import pytest
from rigs.blocks import cell_block
from rigs.tiers import first_fast

from acquisition.delivery.arrival import Arrival, ArrivalModel, HostStamps
from acquisition.delivery.blocks import StampCheck
from core.samples.blocks import SampleBlock, StampFault

NS = 1_000_000_000
START_NS = 1_767_225_600 * NS
RATE_HZ = 600.0


def block(index: int, off_s: float = 0.0, epoch: int = 1) -> SampleBlock:
    """A second of samples whose stamp is off by so much."""
    stamp_ns = START_NS + index * NS + round(off_s * NS)
    counts = np.zeros((1, 600), dtype=np.int16)
    return cell_block(epoch, 600 * index, stamp_ns, 600.0, counts, (True,), ())


def test_stamps_that_fit_are_kept_to_the_nanosecond_and_a_restart_may_have_any_time():
    check = StampCheck()
    for n, off_s in enumerate((0.0, 0.5, -0.3, 0.123456789)):
        checked = check.check(block(n, off_s))
        assert checked.stamp_fault is None
        assert checked.start_ns == block(n, off_s).start_ns
    assert check.check(block(0, -86400.0, epoch=2)).stamp_fault is None


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
def test_a_single_wrong_stamp_is_replaced_by_what_the_index_says(off_s, fault):
    check = StampCheck()
    check.check(block(0))
    checked = check.check(block(1, off_s))
    assert checked.stamp_fault is fault
    assert checked.start_ns == block(1).start_ns
    assert check.check(block(2)).stamp_fault is None
    assert check.n_faults == 1


def test_a_clock_that_was_set_is_believed_from_the_second_stamp_on():
    check = StampCheck()
    check.check(block(0))
    assert check.check(block(1, 3600.0)).stamp_fault is StampFault.JUMPED
    checked = check.check(block(2, 3600.0))
    assert checked.stamp_fault is None
    assert checked.start_ns == block(2, 3600.0).start_ns


@pytest.mark.parametrize("off_s", [-3.8e9, -1.767e9, 2.5e9], ids=["1904", "1970", "2106"])
def test_a_clock_that_has_left_all_possible_years_is_never_believed(off_s):
    check = StampCheck()
    check.check(block(0))
    for n in range(1, 10):
        checked = check.check(block(n, off_s))
        assert checked.stamp_fault is not None
        assert checked.start_ns == block(n).start_ns
    checked = check.check(block(10, 0.25))
    assert checked.stamp_fault is None
    assert checked.start_ns == block(10, 0.25).start_ns


def test_a_clock_that_began_in_1970_may_be_set_and_drift():
    check = StampCheck()
    assert check.check(block(0, -1.767e9)).stamp_fault is None
    assert check.check(block(1, -1.767e9 + 100.0)).stamp_fault is StampFault.JUMPED
    assert check.check(block(2, -1.767e9 + 100.0)).stamp_fault is None
    assert check.check(block(3)).stamp_fault is StampFault.JUMPED
    assert check.check(block(4)).stamp_fault is None


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


@pytest.mark.parametrize("drift", first_fast(2, [150e-6, -150e-6, 0.0, 20e-6]))
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


HOST_NS = 1_767_225_600 * NS
POLL_SAMPLES = 150


def arrival(after_s: float, wrong_s: float = 0.0) -> Arrival:
    """So long after the start, by a host's clock that is wrong."""
    return Arrival(HOST_NS + round((after_s + wrong_s) * NS), 5000.0 + after_s)


def watched(
    duration_s: float,
    drift_ppm: float,
    offset_s: float,
    seed: int,
    wrong_s: Callable[[float], float] = lambda after_s: 0.0,  # noqa: ARG005
) -> ArrivalModel:
    """Polls four times a second, each up to 80 ms late, of a device that samples too fast.

    How wrong the host's clock is may change with time.
    """
    estimate, random = ArrivalModel(RATE_HZ), np.random.default_rng(seed)
    sample_s = 1.0 / (RATE_HZ * (1.0 + drift_ppm * 1e-6))
    for n in range(1, int(duration_s * RATE_HZ / POLL_SAMPLES)):
        true_s = n * POLL_SAMPLES * sample_s
        arrived_s = true_s + 0.002 + random.uniform(0.0, 0.08)
        stamp_ns = HOST_NS + round((true_s + offset_s) * NS)
        arrived = arrival(arrived_s, wrong_s(arrived_s))
        estimate.add(1, n * POLL_SAMPLES, stamp_ns, arrived)
    return estimate


@pytest.mark.parametrize("n_seeds", first_fast(1, [3, 10]))
@pytest.mark.parametrize("drift_ppm", [-150.0, 0.0, 35.0, 400.0])
def test_drift_is_found_within_three_of_its_stated_uncertainty(drift_ppm, n_seeds):
    for seed in range(n_seeds):
        clock = watched(1800.0, drift_ppm, 0.0, seed).device_clock()
        assert clock.u_drift_ppm < 3.0
        assert abs(clock.drift_ppm - drift_ppm) < 3.0 * clock.u_drift_ppm + 0.1


@pytest.mark.parametrize(
    ("offset_s", "step_s", "within_s"),
    [(7.25 - 0.002, 0.0, 0.01), (0.0, 7200.0, 0.1), (0.0, -3600.0, 0.1)],
)
def test_offset_is_read_at_the_least_delay_by_the_present_host_clock(offset_s, step_s, within_s):
    estimate = watched(600.5, 0.0, offset_s + 0.002, 5, lambda s: step_s if s > 600.0 else 0.0)
    assert estimate.device_clock().offset_s == pytest.approx(offset_s - step_s, abs=within_s)


def test_a_device_without_stamps_has_a_drift_but_no_offset():
    estimate = ArrivalModel(RATE_HZ)
    for n in range(600):
        estimate.add(1, 600 * n, None, arrival(n))
    clock = estimate.device_clock()
    assert clock.offset_s is None
    assert clock.drift_ppm == pytest.approx(0.0, abs=0.01)


def test_drift_is_not_told_before_there_is_enough_to_tell_also_after_a_restart():
    assert watched(30.0, 0.0, 0.0, seed=1).device_clock().drift_ppm is None
    estimate = watched(600.0, 100.0, 0.0, seed=3)
    estimate.add(2, 0, HOST_NS, arrival(600.0))
    assert estimate.device_clock().drift_ppm is None


def test_memory_is_bounded():
    estimate = ArrivalModel(RATE_HZ)
    for n in range(5000):
        estimate.add(1, 6000 * n, None, arrival(10.0 * n))
    assert len(estimate._bins) == 360


@pytest.mark.parametrize("step_s", [7200.0, 0.4, -1.0, -1.79e9])
def test_a_step_of_the_hosts_clock_is_no_drift_of_the_device(step_s):
    for after_s in (601.0, 690.0, 1200.0):
        estimate = watched(after_s, 20.0, 0.0, 5, lambda s: step_s if s > 600.0 else 0.0)
        clock = estimate.device_clock()
        if after_s > 680.0 or clock.drift_ppm is not None:
            assert abs(clock.drift_ppm - 20.0) < 5.0 * clock.u_drift_ppm + 0.1


def test_a_device_that_drifts_is_still_found_to_where_the_clock_is_set_again_and_again():
    estimate = watched(1290.0, 400.0, 0.0, 5, lambda s: 3600.0 * (s // 100.0))
    clock = estimate.device_clock()
    assert clock.drift_ppm == pytest.approx(400.0, abs=3.0 * clock.u_drift_ppm)


def test_a_device_whose_first_stamp_is_missing_has_an_offset_from_the_second_on():
    estimate = ArrivalModel(1.0)
    estimate.add(1, 1, None, Arrival(HOST_NS, 0.0))
    assert estimate.device_clock().offset_s is None
    estimate.add(1, 2, HOST_NS + 3 * NS, Arrival(HOST_NS + NS, 1.0))
    assert estimate.device_clock().offset_s == pytest.approx(2.0)


def test_a_host_that_was_suspended_takes_that_for_no_drift():
    """Its steady clock stood still meanwhile, and the device went on."""
    estimate, asleep_s = ArrivalModel(RATE_HZ), 300.0
    for n in range(900):
        slept_s = asleep_s if n > 300 else 0.0
        awake = Arrival(HOST_NS + round((n + slept_s) * NS), float(n))
        estimate.add(1, round(RATE_HZ * (n + slept_s)), None, awake)
    assert estimate.device_clock().drift_ppm == pytest.approx(0.0, abs=0.01)
