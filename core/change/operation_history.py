"""Operating states of a whole history at once: what `advance` says reading by reading."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray, TimeArray
from core.baseline.stiffness_history import CodeArray
from core.condition.oil_settling import oil_settled
from core.condition.operating_state import STEADY, Band, OperatingLimits, OperatingState

_Bools = npt.NDArray[np.bool_]
_Ints = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class OperationHistory:
    """Operating state of every reading.

    Parameters
    ----------
    state : (n,)
        Members of `OperatingState`.
    is_settled : (n,)
    """

    state: CodeArray
    is_settled: _Bools


def operation_history(
    time_ns: TimeArray,
    speed_rpm: FloatArray,
    power_mw: FloatArray,
    limits: OperatingLimits,
    oil_temperature_c: FloatArray | None = None,
) -> OperationHistory:
    """Follow a unit's state over all readings.

    Parameters
    ----------
    time_ns, speed_rpm, power_mw : (n,)
        Strictly increasing; NaN where there is no number.
    oil_temperature_c : (n,), optional
        Of the bearing; without it films warm up for the longest time.
    """
    starts = _starts(time_ns, limits)
    speed = _passed(speed_rpm, limits.speed_bands_rpm, starts)
    power = _passed(power_mw, limits.power_bands_mw, starts)
    is_known, is_moving = ~np.isnan(speed_rpm), speed == 1
    came_from = _last(~is_moving, starts)
    is_from_known = (came_from >= 0) & is_known[came_from]
    was_at_speed = is_from_known & (speed[came_from] == 2)
    state = np.full(time_ns.size, OperatingState.UNKNOWN, np.int8)
    state[is_moving & is_from_known] = OperatingState.RUN_UP
    state[is_moving & was_at_speed] = OperatingState.RUN_DOWN
    state[is_known & (speed == 0)] = OperatingState.STANDSTILL
    loaded = is_known & (speed == 2) & ~np.isnan(power_mw)
    state[loaded] = OperatingState.SPEED_NO_LOAD + power[loaded]
    is_warm = _warm(time_ns, is_known, speed == 2, limits, oil_temperature_c)
    return OperationHistory(state, is_warm & _settled(time_ns, state, starts, limits))


def operation_of_states(
    time_ns: TimeArray,
    state: CodeArray,
    limits: OperatingLimits,
    oil_temperature_c: FloatArray | None = None,
) -> OperationHistory:
    """Settling where states are told, as in files of readings, and not followed.

    Parameters
    ----------
    state : (n,)
        Members of `OperatingState`.
    oil_temperature_c : (n,), optional
        Of the bearing; without it films warm up for the longest time.
    """
    starts = _starts(time_ns, limits)
    is_steady = np.isin(state, [int(s) for s in STEADY])
    is_known = state != OperatingState.UNKNOWN
    is_warm = _warm(time_ns, is_known, is_steady, limits, oil_temperature_c)
    return OperationHistory(state, is_warm & _settled(time_ns, state, starts, limits))


def _starts(time_ns: TimeArray, limits: OperatingLimits) -> _Ints:
    """(n,) row of the first reading after the last gap that is not bridged."""
    is_first = np.ones(time_ns.size, np.bool_)
    is_first[1:] = np.diff(time_ns) > limits.longest_gap_ns
    return _last(is_first, np.zeros(time_ns.size, np.int64))


def _last(happens: _Bools, starts: _Ints) -> _Ints:
    """(n,) row in which something happened last, since the start; -1 if it has not."""
    rows = np.where(happens, np.arange(happens.size), -1)
    found = np.maximum.accumulate(rows) if rows.size else rows
    return np.where(found >= starts, found, -1)


def _passed(value: FloatArray, bands: tuple[Band, Band], starts: _Ints) -> _Ints:
    """(n,) number of limits that are passed, each with its hysteresis."""
    since_lost = _last(np.isnan(value), starts)
    starts = np.maximum(starts, since_lost + 1)
    is_first = starts == np.arange(value.size)
    count = np.zeros(value.size, np.int64)
    for low, middle, high in bands:
        on = (value >= high) | (is_first & (value >= middle))
        off = (value < low) | (is_first & (value < middle))
        count += _last(on, starts) > _last(off, starts)
    return count


def _settled(
    time_ns: TimeArray, state: CodeArray, starts: _Ints, limits: OperatingLimits
) -> _Bools:
    is_new = np.ones(time_ns.size, np.bool_)
    is_new[1:] = np.diff(state) != 0
    is_new |= starts == np.arange(time_ns.size)
    since = _last(is_new, np.zeros(time_ns.size, np.int64))
    is_steady = np.isin(state, [int(s) for s in STEADY])
    return is_steady & (time_ns - time_ns[since] >= limits.settling_ns)


def _warm(
    time_ns: TimeArray,
    is_known: _Bools,
    is_at_speed: _Bools,
    limits: OperatingLimits,
    oil_temperature_c: FloatArray | None,
) -> _Bools:
    """Whether the unit has been at speed until the bearing was warm; False where not known."""
    rows = np.flatnonzero(is_known)
    known_ns, at_speed = time_ns[rows], is_at_speed[rows]
    starts = np.ones(rows.size, np.bool_)
    starts[1:] = (np.diff(known_ns) > limits.longest_gap_ns) | ~at_speed[:-1]
    since = _last(starts, np.zeros(rows.size, np.int64))
    is_warm = known_ns - known_ns[since] >= limits.warm_up_ns
    if oil_temperature_c is not None:
        stretch = np.where(at_speed, since, -1)
        is_warm |= oil_settled(known_ns, oil_temperature_c[rows], stretch, limits)
    warm = np.zeros(time_ns.size, np.bool_)
    warm[rows] = at_speed & is_warm
    return warm
