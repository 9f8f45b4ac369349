"""The operating state of a unit, and how it follows from speed and power reading by reading."""

import math
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import TypeAlias

from core.units import ns_from_s

Band: TypeAlias = tuple[float, float, float]
"""Below the first a limit is no longer passed, from the third on it is; the second decides when
nothing is known of before."""


@dataclass(frozen=True)
class OperatingLimits:
    """Limits of operating states, as shares of rated speed and power.

    Parameters
    ----------
    standing_below, at_speed_above
        Share of the rated speed below which a unit stands still, and above which it is at speed.
    loaded_above, full_load_above
        Share of the rated power above which it is at part load, and at full load.
    speed_hysteresis, power_hysteresis
        How far beyond a limit, up or down, a reading must be for the limit to count as crossed.
    settling_s
        Time in one state before readings count as settled: they are averages over about five
        minutes, and the shaft takes its place within minutes.
    oil_band_c, oil_settling_s
        Oil has settled after a start once its temperature has stayed within a band of this width
        for this time at speed. Clearances close for hours after a start, later than the oil warms
        (Brito et al., Tables 8 and 9): until then films at the same eccentricity and oil
        temperature are not alike. Where clearance lags with 1.2 h and oil with 0.8 h, 1.7 % of the
        closing is left after a start from cold, and less after a short stop.
    warm_up_s
        Time at speed after which readings count even if the oil has not settled, as where the load
        follows the grid.
    longest_gap_s
        Time without readings after which nothing is known of what the unit did.

    Raises
    ------
    ValueError
        With key and value, if a limit is not a number above zero, or limits overlap.
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

    def __post_init__(self) -> None:
        for key in (field.name for field in fields(self)):
            value = getattr(self, key)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{key} = {value:g} must be a number above 0")
        self._check_order("standing_below", "at_speed_above", self.speed_hysteresis)
        self._check_order("loaded_above", "full_load_above", self.power_hysteresis)

    def _check_order(self, lower: str, upper: str, hysteresis: float) -> None:
        low, high = getattr(self, lower), getattr(self, upper)
        if not (hysteresis < low and low + hysteresis < high - hysteresis):
            raise ValueError(
                f"{lower} = {low:g} and {upper} = {high:g} must be above 0 and apart from each"
                f" other by more than their hysteresis of {hysteresis:g}"
            )

    @property
    def settling_ns(self) -> int:
        """Settling time."""
        return ns_from_s(self.settling_s)

    @property
    def oil_settling_ns(self) -> int:
        """Time for which oil stays near one temperature once it has settled."""
        return ns_from_s(self.oil_settling_s)

    @property
    def warm_up_ns(self) -> int:
        """Longest time at speed until readings count."""
        return ns_from_s(self.warm_up_s)

    @property
    def longest_gap_ns(self) -> int:
        """Longest gap that is bridged."""
        return ns_from_s(self.longest_gap_s)

    @property
    def speed_bands_rpm(self) -> tuple[Band, Band]:
        """Around standing still and being at speed."""
        h = self.speed_hysteresis
        return (
            _band(self.standing_below, h, self.rated_speed_rpm),
            _band(self.at_speed_above, h, self.rated_speed_rpm),
        )

    @property
    def power_bands_mw(self) -> tuple[Band, Band]:
        """Around part load and full load."""
        h = self.power_hysteresis
        return (
            _band(self.loaded_above, h, self.rated_power_mw),
            _band(self.full_load_above, h, self.rated_power_mw),
        )


def _band(share: float, hysteresis: float, rated: float) -> Band:
    return (share - hysteresis) * rated, share * rated, (share + hysteresis) * rated


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
