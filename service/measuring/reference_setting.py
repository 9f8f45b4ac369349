"""What a reference is made of: gaps given by hand, or those measured just now."""

from core.machine.unit import Bearing
from core.quality import Level
from core.units import s_from_ns
from service.measuring.references import opposite_axes
from service.runtime.times import rfc3339
from service.store.gap_reference import MicrometrePair
from service.store.port import StoredReadings

MAX_AGE_S = 600.0
"""Older gaps say little of where the shaft is now."""

NEAR_GAPS = ("gap_x_um", "gap_y_um")
OPPOSITE_GAPS = ("opposite_gap_x_um", "opposite_gap_y_um")

GivenPair = tuple[float | None, float | None]
Gaps = tuple[MicrometrePair, MicrometrePair | None]
"""Of the probes on the positive axes, and of those across the shaft if there are any."""


class ReferenceRefusedError(Exception):
    """No reference can be made of this; the message says why."""


def given_gaps(bearing: Bearing, near: GivenPair, opposite: GivenPair) -> Gaps:
    """Gaps in µm as they were given, complete for the probes that the bearing has.

    Raises
    ------
    ReferenceRefusedError
        If some are missing, or given for probes that are not there.
    """
    x, y = near
    if x is None or y is None:
        raise ReferenceRefusedError("give the gaps of both axes, x and y, or let them be measured")
    for axis, gap_um, is_there in zip("xy", opposite, opposite_axes(bearing), strict=True):
        if gap_um is None and is_there:
            raise ReferenceRefusedError(
                f"bearing {bearing.id} has an opposite probe in {axis}: give its gap as well"
            )
        if gap_um is not None and not is_there:
            raise ReferenceRefusedError(f"bearing {bearing.id} has no opposite probe in {axis}")
    return (x, y), _across(bearing, (x, y), opposite)


def measured_gaps(bearing: Bearing, newest: StoredReadings | None, now_ns: int) -> Gaps:
    """Mean gaps in µm of the newest stored result.

    Raises
    ------
    ReferenceRefusedError
        If there is none, it is not of the last ten minutes, or its gaps are not usable.
    """
    if newest is None:
        raise ReferenceRefusedError("there is no stored result yet whose gaps could be taken")
    _check_age(newest.time_ns, now_ns)
    near = (_usable(newest, NEAR_GAPS[0]), _usable(newest, NEAR_GAPS[1]))
    x, y = (
        _usable(newest, name) if is_there else None
        for name, is_there in zip(OPPOSITE_GAPS, opposite_axes(bearing), strict=True)
    )
    return near, _across(bearing, near, (x, y))


def doubts(newest: StoredReadings) -> list[str]:
    """What should be known of gaps that are usable but not good, in words."""
    gaps = {name: newest.readings.get(name) for name in (*NEAR_GAPS, *OPPOSITE_GAPS)}
    return [
        f"{name} is uncertain: {reading.quality.reason}"
        for name, reading in gaps.items()
        if reading is not None and reading.quality.level is Level.UNCERTAIN
    ]


def _across(bearing: Bearing, near: MicrometrePair, found: GivenPair) -> MicrometrePair | None:
    """Gaps of the opposite probes; an axis without one keeps a number that nobody looks at."""
    if not any(opposite_axes(bearing)):
        return None
    unused = bearing.opposite_reference_um or near
    x, y = (old if new is None else new for new, old in zip(found, unused, strict=True))
    return x, y


def _check_age(time_ns: int, now_ns: int) -> None:
    age_s = s_from_ns(now_ns - time_ns)
    if abs(age_s) > MAX_AGE_S:
        side = "ago" if age_s > 0.0 else "ahead of this computer's clock"
        raise ReferenceRefusedError(
            f"the newest stored result is of {rfc3339(time_ns)}, {abs(age_s) / 60:.0f} min {side};"
            f" it may be at most {MAX_AGE_S / 60:.0f} min old"
        )


def _usable(newest: StoredReadings, name: str) -> float:
    reading = newest.readings.get(name)
    if reading is None:
        raise ReferenceRefusedError(f"the newest stored result has no {name}")
    if reading.value is None:
        raise ReferenceRefusedError(
            f"{name} of the newest stored result has no value: {reading.quality.reason}"
        )
    return reading.value
