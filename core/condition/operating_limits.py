"""At which speed and power an operating state begins and ends."""

import math
from dataclasses import dataclass, fields
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
