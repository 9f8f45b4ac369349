"""Operating state of a unit, updated reading by reading, and settling of the bearing oil.

After a start, the oil warms up and clearances close. The duration depends on the machine and on the
length of the standstill, so it is derived from the oil temperature: the oil has settled when its
temperature has stayed within a band for a given time. Later changes due to load or weather do not
reset this, because the oil temperature is part of the film condition.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

from core.units import ns_from_s


@dataclass(frozen=True)
class OperatingLimits:
    """Limits of operating states, as fractions of rated speed and power.

    Parameters
    ----------
    standing_below
        Fraction of the rated speed below which the unit is at standstill.
    at_speed_above
        Fraction of the rated speed above which the unit is at rated speed.
    loaded_above
        Fraction of the rated power above which the unit is at part load.
    full_load_above
        Fraction of the rated power above which the unit is at full load.
    speed_hysteresis, power_hysteresis
        Fraction of the rated value by which a limit must be passed, up or down, to be crossed.
    settling_s
        Time in one state after which readings count as settled. Readings are averages over about
        five minutes, and the shaft reaches its position within minutes.
    oil_band_c
        Width of the temperature band in which the oil must stay to count as settled after a start.
    oil_settling_s
        Time at speed with the oil within the band, after which it counts as settled. Clearances
        close for hours after a start, longer than the oil warms up (Brito et al., Tables 8 and 9).
        With time constants of 1.2 h (clearance) and 0.8 h (oil), 1.7 % of the closing remains after
        a cold start, and less after a short stop.
    warm_up_s
        Time at speed after which readings count even if the oil has not settled, for example with
        a load that follows the grid.
    longest_gap_s
        Longest gap between readings across which the operating state continues.
    """

    rated_speed_rpm: float
    rated_power_mw: float
    standing_below: float = 0.05
    at_speed_above: float = 0.95
    loaded_above: float = 0.05
    full_load_above: float = 0.85
    speed_hysteresis: float = 0.02
    power_hysteresis: float = 0.02
    settling_s: float = 1800.0
    oil_band_c: float = 0.5
    oil_settling_s: float = 7200.0
    warm_up_s: float = 21_600.0
    longest_gap_s: float = 3600.0


class OperatingState(IntEnum):
    """Operating state of a unit; stored in one byte."""

    UNKNOWN = 0
    STANDSTILL = 1
    RUN_UP = 2
    SPEED_NO_LOAD = 3
    PART_LOAD = 4
    FULL_LOAD = 5
    RUN_DOWN = 6


UNDER_LOAD = (OperatingState.SPEED_NO_LOAD, OperatingState.PART_LOAD, OperatingState.FULL_LOAD)
"""States at rated speed, indexed by the number of exceeded power limits."""

STEADY = frozenset(UNDER_LOAD)
"""States at rated speed, in which films are compared."""


@dataclass(frozen=True)
class Operation:
    """Operating state of a unit with its start time, and the memory needed for the next update.

    Parameters
    ----------
    since_ns
        Time of the first reading in this state; None before the first reading.
    last_ns
        Time of the newest reading, ns since 1970 UTC; None before the first reading.
    speed_passed, power_passed
        Whether the (lower, upper) limit is reached or exceeded; None before the first reading.
    was_at_speed
        While the speed is between both limits: whether the unit was last at rated speed (true) or
        at standstill (false).
    at_speed_from_ns, at_speed_to_ns
        Times of the first and newest reading of the present period at rated speed; None if the
        unit is not at rated speed.
    """

    state: OperatingState = OperatingState.UNKNOWN
    since_ns: int | None = None
    last_ns: int | None = None
    at_speed_from_ns: int | None = None
    at_speed_to_ns: int | None = None
    speed_passed: tuple[bool, bool] | None = None
    power_passed: tuple[bool, bool] | None = None
    was_at_speed: bool | None = None

    def is_settled(self, limits: OperatingLimits, has_oil_settled: bool = False) -> bool:
        """Whether the unit is warm, and has been in one state at rated speed for `settling_s`.

        It is warm if the oil has settled, or after `warm_up_s` at rated speed.
        """
        now_ns, since_ns, from_ns = self.last_ns, self.since_ns, self.at_speed_from_ns
        if self.state not in STEADY or now_ns is None or since_ns is None or from_ns is None:
            return False
        is_warm = has_oil_settled or now_ns - from_ns >= ns_from_s(limits.warm_up_s)
        return is_warm and now_ns - since_ns >= ns_from_s(limits.settling_s)


UNKNOWN_OPERATION = Operation()


def step_operation(
    operation: Operation,
    time_ns: int,
    speed_rpm: float,
    power_mw: float,
    limits: OperatingLimits,
    state: OperatingState | None = None,
) -> Operation:
    """Return the operation updated with one reading.

    A gap longer than `limits.longest_gap_s` resets the operation. Shorter gaps without a speed do
    not end the period at rated speed.

    Parameters
    ----------
    time_ns, speed_rpm, power_mw
        Time of the reading, ns since 1970 UTC; speed and power, NaN if missing.
    state
        State from a file of readings, used instead of speed and power; None to compute the state.

    Raises
    ------
    ValueError
        If the reading is not later than the previous reading.
    """
    longest_ns = ns_from_s(limits.longest_gap_s)
    if operation.last_ns is not None:
        if time_ns <= operation.last_ns:
            raise ValueError(
                f"reading at {time_ns} ns must be after the previous reading at"
                f" {operation.last_ns} ns"
            )
        if time_ns - operation.last_ns > longest_ns:
            operation = UNKNOWN_OPERATION
    speed, power, was_at_speed = None, None, None
    if state is None:
        shares, rated = (limits.standing_below, limits.at_speed_above), limits.rated_speed_rpm
        speed = _passed(speed_rpm, operation.speed_passed, shares, limits.speed_hysteresis, rated)
        shares, rated = (limits.loaded_above, limits.full_load_above), limits.rated_power_mw
        power = _passed(power_mw, operation.power_passed, shares, limits.power_hysteresis, rated)
        is_at_speed = None if speed is None else speed[1]
        was_at_speed = operation.was_at_speed if speed == BETWEEN else is_at_speed
        state = _state(speed, power, was_at_speed)
    else:
        is_at_speed = None if state is OperatingState.UNKNOWN else state in STEADY
    since_ns = operation.since_ns if state == operation.state else None
    from_ns, to_ns = operation.at_speed_from_ns, operation.at_speed_to_ns
    if is_at_speed:
        lasts = to_ns is not None and time_ns - to_ns <= longest_ns
        from_ns, to_ns = (from_ns if lasts else time_ns), time_ns
    elif is_at_speed is not None:
        from_ns, to_ns = None, None
    return Operation(
        state,
        since_ns=time_ns if since_ns is None else since_ns,
        last_ns=time_ns,
        at_speed_from_ns=from_ns,
        at_speed_to_ns=to_ns,
        speed_passed=speed,
        power_passed=power,
        was_at_speed=was_at_speed,
    )


BETWEEN = (True, False)
"""`Operation.speed_passed` of a speed between the lower and the upper limit."""


def _passed(
    value: float,
    before: tuple[bool, bool] | None,
    shares: tuple[float, float],
    hysteresis: float,
    rated: float,
) -> tuple[bool, bool] | None:
    """Return whether each of two limits is reached, with hysteresis if `before` is known."""
    if math.isnan(value):
        return None
    lower, upper = (
        value
        >= (share if was is None else share - hysteresis if was else share + hysteresis) * rated
        for share, was in zip(shares, before or (None, None), strict=True)
    )
    return lower, upper


def _state(
    speed: tuple[bool, bool] | None, power: tuple[bool, bool] | None, was_at_speed: bool | None
) -> OperatingState:
    if speed is None or (speed == BETWEEN and was_at_speed is None):
        return OperatingState.UNKNOWN
    if speed == BETWEEN:
        return OperatingState.RUN_DOWN if was_at_speed else OperatingState.RUN_UP
    if not speed[0]:
        return OperatingState.STANDSTILL
    return OperatingState.UNKNOWN if power is None else UNDER_LOAD[sum(power)]


OIL_LEVELS = 8
"""Number of oil temperatures that are stored per settling time."""


@dataclass(frozen=True)
class OilSettling:
    """Settling of the oil of a bearing in one period at rated speed.

    Parameters
    ----------
    stretch_ns
        Time of the first reading of the period; None while the unit is not at rated speed.
    levels
        Times in ns and temperatures in °C over the settling time, oldest first.
    """

    stretch_ns: int | None = None
    levels: tuple[tuple[int, float], ...] = ()
    has_settled: bool = False

    def step(self, operation: Operation, oil_c: float, limits: OperatingLimits) -> "OilSettling":
        """Return the settling updated with an oil temperature in °C; NaN if there is no reading.

        `operation` is the operation of the unit at the time of the temperature.
        """
        now_ns = operation.last_ns
        if now_ns is None or operation.at_speed_from_ns is None:
            return NOT_AT_SPEED
        if operation.at_speed_to_ns != now_ns:
            return self  # present speed is unknown
        is_new = operation.at_speed_from_ns != self.stretch_ns
        settling = OilSettling(operation.at_speed_from_ns) if is_new else self
        if settling.has_settled or math.isnan(oil_c):
            return settling
        levels, span_ns = settling.levels, ns_from_s(limits.oil_settling_s)
        if not levels or now_ns - levels[-1][0] >= span_ns // OIL_LEVELS:
            levels = (*levels, (now_ns, oil_c))
        while len(levels) > 1 and now_ns - levels[1][0] >= span_ns:
            levels = levels[1:]
        seen_c = (oil_c, *(level_c for _, level_c in levels))
        is_near = max(seen_c) - min(seen_c) <= limits.oil_band_c
        has_settled = is_near and now_ns - levels[0][0] >= span_ns
        return OilSettling(settling.stretch_ns, levels, has_settled)


NOT_AT_SPEED = OilSettling()
