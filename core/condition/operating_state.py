"""`OperatingState` of a unit from speed and power, with hysteresis and settling time."""

import math
from dataclasses import dataclass
from enum import IntEnum

from core.condition.operating_limits import OperatingLimits


class OperatingState(IntEnum):
    """What a unit does; as small numbers, so that years of it fit into a column."""

    UNKNOWN = 0
    STANDSTILL = 1
    RUN_UP = 2
    SPEED_NO_LOAD = 3
    PART_LOAD = 4
    FULL_LOAD = 5
    RUN_DOWN = 6


STEADY = frozenset(
    {OperatingState.SPEED_NO_LOAD, OperatingState.PART_LOAD, OperatingState.FULL_LOAD}
)
"""States in which films are compared: the shaft turns at its rated speed."""

UNDER_LOAD = (OperatingState.SPEED_NO_LOAD, OperatingState.PART_LOAD, OperatingState.FULL_LOAD)
"""State at rated speed by the number of power limits that are passed."""


@dataclass(frozen=True)
class OperatingReading:
    """Speed and power at one moment; NaN where there is no number."""

    time_ns: int
    speed_rpm: float
    power_mw: float


@dataclass(frozen=True)
class Operation:
    """What a unit does, since when, and what must be remembered to go on from here.

    Parameters
    ----------
    since_ns
        First reading in this state without interruption; None before the first reading.
    last_ns
        Newest reading.
    speed_passed, power_passed
        Which limits are passed, lower and upper; None where it is not known.
    was_at_speed
        Whether it was at rated speed (or stood still) last, while it is between the two.
    at_speed_from_ns, at_speed_to_ns
        First and newest reading of the stretch at rated speed; None if it is not, or not known.
    """

    state: OperatingState = OperatingState.UNKNOWN
    since_ns: int | None = None
    last_ns: int | None = None
    speed_passed: tuple[bool, bool] | None = None
    power_passed: tuple[bool, bool] | None = None
    was_at_speed: bool | None = None
    at_speed_from_ns: int | None = None
    at_speed_to_ns: int | None = None

    def is_steady(self, limits: OperatingLimits) -> bool:
        """Whether a steady state has lasted for the settling time."""
        if self.state not in STEADY or self.since_ns is None or self.last_ns is None:
            return False
        return self.last_ns - self.since_ns >= limits.settling_ns

    def is_settled(self, limits: OperatingLimits, has_oil_settled: bool = False) -> bool:
        """Whether a steady state has lasted for the settling time, after the warm-up."""
        if not self.is_steady(limits) or self.last_ns is None or self.at_speed_from_ns is None:
            return False
        return has_oil_settled or self.last_ns - self.at_speed_from_ns >= limits.warm_up_ns


NEVER_SEEN = Operation()


def advance(operation: Operation, reading: OperatingReading, limits: OperatingLimits) -> Operation:
    """Take in one reading of speed and power.

    A gap longer than `limits.longest_gap_s` ends everything that is remembered: what the machine
    did meanwhile is not known.

    Raises
    ------
    ValueError
        If the reading is not later than the one before.
    """
    if operation.last_ns is not None and reading.time_ns <= operation.last_ns:
        raise ValueError(f"reading at {reading.time_ns} ns is not after {operation.last_ns} ns")
    if (
        operation.last_ns is not None
        and reading.time_ns - operation.last_ns > limits.longest_gap_ns
    ):
        operation = NEVER_SEEN
    speed = _passed(reading.speed_rpm, operation.speed_passed, limits.speed_bands_rpm)
    power = _passed(reading.power_mw, operation.power_passed, limits.power_bands_mw)
    was_at_speed = operation.was_at_speed if speed == BETWEEN else _extreme(speed)
    state = _state(speed, power, was_at_speed)
    lasts = state == operation.state and operation.since_ns is not None
    at_speed_from_ns, at_speed_to_ns = _at_speed(operation, reading.time_ns, speed, limits)
    return Operation(
        state=state,
        since_ns=operation.since_ns if lasts else reading.time_ns,
        last_ns=reading.time_ns,
        speed_passed=speed,
        power_passed=power,
        was_at_speed=was_at_speed,
        at_speed_from_ns=at_speed_from_ns,
        at_speed_to_ns=at_speed_to_ns,
    )


BETWEEN = (True, False)
"""Above the lower limit, not above the upper."""


def _passed(
    value: float,
    before: tuple[bool, bool] | None,
    bands: tuple[tuple[float, float, float], tuple[float, float, float]],
) -> tuple[bool, bool] | None:
    """Which of two limits are passed, each with its hysteresis."""
    if math.isnan(value):
        return None
    lower, upper = (
        value >= (middle if before is None else low if before[index] else high)
        for index, (low, middle, high) in enumerate(bands)
    )
    return lower, upper


def _at_speed(
    operation: Operation,
    now_ns: int,
    speed: tuple[bool, bool] | None,
    limits: OperatingLimits,
) -> tuple[int | None, int | None]:
    """First and newest reading at speed; a few readings without a speed do not end the stretch."""
    from_ns, to_ns = operation.at_speed_from_ns, operation.at_speed_to_ns
    if speed is None:
        return from_ns, to_ns
    if not speed[1]:
        return None, None
    lasts = to_ns is not None and now_ns - to_ns <= limits.longest_gap_ns
    return (from_ns if lasts else now_ns), now_ns


def _extreme(speed: tuple[bool, bool] | None) -> bool | None:
    return None if speed is None else speed[1]


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
