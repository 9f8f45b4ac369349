"""Unit conversions between signal units (µm, r/min) and SI units."""

import math

STANDARD_GRAVITY_M_S2 = 9.80665
NS_PER_S = 1_000_000_000
DAY_NS = 86_400 * NS_PER_S


def hz_from_rpm(speed_rpm: float) -> float:
    """Return the 1× frequency, in Hz, of a running speed in r/min."""
    return speed_rpm / 60.0


def rpm_from_hz(frequency_hz: float) -> float:
    """Return the running speed, in r/min, of a 1× frequency in Hz."""
    return frequency_hz * 60.0


def rad_s_from_rpm(speed_rpm: float) -> float:
    """Return the angular speed, in rad/s, of a running speed in r/min."""
    return speed_rpm * 2.0 * math.pi / 60.0


def um_from_m(length_m: float) -> float:
    """Convert metres to micrometres."""
    return length_m * 1e6


def s_from_ns(duration_ns: int) -> float:
    """Convert a duration from nanoseconds to seconds; a float is too inexact for absolute times."""
    return duration_ns / NS_PER_S


def ns_from_s(duration_s: float) -> int:
    """Convert seconds to nanoseconds, rounded to the nearest integer."""
    return round(duration_s * NS_PER_S)
