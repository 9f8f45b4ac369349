"""The only place where signal units (µm, mm/s, r/min) meet mechanical units (SI)."""

import math

STANDARD_GRAVITY_M_S2 = 9.80665
NS_PER_S = 1_000_000_000
DAY_NS = 86_400 * NS_PER_S


def hz_from_rpm(speed_rpm: float) -> float:
    """Frequency of one turn."""
    return speed_rpm / 60.0


def rpm_from_hz(frequency_hz: float) -> float:
    """Running speed whose 1× frequency is given."""
    return frequency_hz * 60.0


def rad_s_from_rpm(speed_rpm: float) -> float:
    """Angular speed of a shaft."""
    return speed_rpm * 2.0 * math.pi / 60.0


def um_from_m(length_m: float) -> float:
    """Metres to micrometres."""
    return length_m * 1e6


def s_from_ns(duration_ns: int) -> float:
    """Nanoseconds to seconds; for durations, since a float cannot hold a date to the nanosecond."""
    return duration_ns / NS_PER_S


def ns_from_s(duration_s: float) -> int:
    """Seconds to nanoseconds, rounded to the nearest."""
    return round(duration_s * NS_PER_S)
