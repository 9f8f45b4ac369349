"""The sample index rules; stamps that do not fit it are told, not believed."""

import numpy as np
import pytest

from acquisition.raw import RawBlock
from acquisition.stamps import StampCheck
from core.device_clock import StampFault

NS = 1_000_000_000
START_NS = 1_767_225_600 * NS


def block(index: int, off_s: float = 0.0, epoch: int = 1) -> RawBlock:
    """A second of samples whose stamp is off by so much."""
    stamp_ns = START_NS + index * NS + round(off_s * NS)
    counts = np.zeros((1, 600), dtype=np.int16)
    return RawBlock(epoch, 600 * index, stamp_ns, 600.0, counts, (True,), ())


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
