"""One reading of a watched quantity, as a decision takes it in."""

from dataclasses import dataclass

from core.baseline.stiffness_history import Evidence


@dataclass(frozen=True)
class WatchedReading:
    """A quantity with the condition that it was read under; NaN where there is no number.

    Parameters
    ----------
    is_settled
        Whether the unit had settled in a steady state.
    value, u_random
        ln of the quantity, and its random standard uncertainty.
    """

    time_ns: int
    is_settled: bool
    eccentricity_ratio: float
    oil_temperature_c: float
    attitude_deg: float
    value: float
    u_random: float
    evidence: Evidence = Evidence.MEASURED
