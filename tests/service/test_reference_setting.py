"""A reference is complete, recent and usable, or refused with the reason."""

from typing import Any

import pytest

from core.machine import Bearing
from core.quality import Reading, Reason, missing, uncertain
from service.reference_setting import ReferenceRefusedError, doubts, given_gaps, measured_gaps
from service.store.port import StoredReadings

NOW = 1_767_225_600_000_000_000
MINUTE = 60_000_000_000
NONE = (None, None)


def bearing(**probes: Any) -> Bearing:
    return Bearing("UJB", 1e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0), **probes)


FOUR = bearing(opposite_x="fx", opposite_y="fy", opposite_reference_um=(1900.0, 1901.0))
THREE = bearing(opposite_x="fx", opposite_reference_um=(1900.0, 1901.0))


def newest(age_min: float = 1.0, **readings: Reading) -> StoredReadings:
    absent = missing(Reason.NOT_MEASURED)
    everything = {
        "gap_x_um": Reading(1998.5),
        "gap_y_um": Reading(2003.1),
        "opposite_gap_x_um": absent,
        "opposite_gap_y_um": absent,
    }
    return StoredReadings(NOW - round(age_min * MINUTE), everything | readings)


def test_as_many_gaps_are_needed_as_there_are_probes() -> None:
    assert given_gaps(bearing(), (1.0, 2.0), NONE) == ((1.0, 2.0), None)
    assert given_gaps(FOUR, (1.0, 2.0), (3.0, 4.0)) == ((1.0, 2.0), (3.0, 4.0))
    assert given_gaps(THREE, (1.0, 2.0), (3.0, None)) == ((1.0, 2.0), (3.0, 1901.0))


@pytest.mark.parametrize(
    ("of", "near", "opposite", "said"),
    [
        (bearing(), (1.0, None), NONE, "both axes, x and y"),
        (bearing(), (None, 1.0), NONE, "both axes, x and y"),
        (bearing(), NONE, NONE, "both axes, x and y"),
        (bearing(), (1.0, 2.0), (None, 3.0), "no opposite probe in y"),
        (FOUR, (1.0, 2.0), NONE, "an opposite probe in x: give its gap"),
        (FOUR, (1.0, 2.0), (3.0, None), "an opposite probe in y: give its gap"),
        (THREE, (1.0, 2.0), (3.0, 4.0), "no opposite probe in y"),
    ],
)
def test_gaps_that_do_not_fit_the_probes_are_refused(
    of: Bearing, near: Any, opposite: Any, said: str
) -> None:
    with pytest.raises(ReferenceRefusedError, match=said):
        given_gaps(of, near, opposite)


@pytest.mark.parametrize("age_min", [0.0, 9.9, -9.9])
def test_the_newest_mean_gaps_become_the_reference(age_min: float) -> None:
    assert measured_gaps(bearing(), newest(age_min), NOW) == ((1998.5, 2003.1), None)


def test_opposite_gaps_are_measured_where_there_are_probes() -> None:
    found = newest(opposite_gap_x_um=Reading(7.0), opposite_gap_y_um=Reading(8.0))

    assert measured_gaps(FOUR, found, NOW) == ((1998.5, 2003.1), (7.0, 8.0))
    assert measured_gaps(THREE, found, NOW) == ((1998.5, 2003.1), (7.0, 1901.0))


@pytest.mark.parametrize(
    ("found", "said"),
    [
        (None, "no stored result yet"),
        (newest(23.0), r"of 2025-12-31T23:37:00\.000Z, 23 min ago; it may be at most 10 min old"),
        (newest(10.1), "10 min ago"),
        (newest(-23.0), "23 min ahead of this computer's clock"),
        (newest(gap_y_um=missing(Reason.SENSOR_FAILURE)), "gap_y_um .* no value: sensor_failure"),
        (StoredReadings(NOW, {"gap_y_um": Reading(1.0)}), "has no gap_x_um"),
    ],
)
def test_gaps_that_are_old_or_unusable_are_refused(found: StoredReadings | None, said: str) -> None:
    with pytest.raises(ReferenceRefusedError, match=said):
        measured_gaps(bearing(), found, NOW)
    with pytest.raises(ReferenceRefusedError, match=r"opposite_gap_y_um .* not_measured"):
        measured_gaps(FOUR, newest(opposite_gap_x_um=Reading(7.0)), NOW)


def test_doubtful_gaps_are_taken_and_named() -> None:
    found = newest(gap_x_um=Reading(1998.5, uncertain(Reason.NON_STATIONARY)))

    assert measured_gaps(bearing(), found, NOW) == ((1998.5, 2003.1), None)
    assert doubts(found) == ["gap_x_um is uncertain: non_stationary"]
    assert doubts(newest()) == []
