"""Spectra over time as the rest of the service sees them."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

from core.arrays import FloatArray
from core.condition.operating_state import OperatingState
from core.quality import Quality
from core.units import ns_from_s

N_CHANNELS = 4
"""Shaft x and y, bearing x and y."""


class Tier(IntEnum):
    """How densely spectra are kept; the numbers stand in the database."""

    DENSE = 0
    SPARSE = 1


@dataclass(frozen=True)
class TierLimits:
    """One spectrum of each bearing is kept for every stretch of time, and so many of them."""

    every_s: float
    n_most: int

    def slot(self, time_ns: int) -> int:
        """Number of the stretch that a time lies in."""
        return time_ns // ns_from_s(self.every_s)


@dataclass(frozen=True)
class SpectraLimits:
    """How many spectra are kept.

    Parameters
    ----------
    n_most_lines
        Of each channel, from the lowest frequency on; what lies above is not kept.
    """

    dense: TierLimits = TierLimits(60.0, 1440)
    sparse: TierLimits = TierLimits(600.0, 52_560)
    n_most_lines: int = 1000

    @property
    def tiers(self) -> tuple[tuple[Tier, TierLimits], ...]:
        """Both, with what is kept in them."""
        return (Tier.DENSE, self.dense), (Tier.SPARSE, self.sparse)


@dataclass(frozen=True)
class SpectraQuery:
    """Which spectra of one bearing are wanted.

    Parameters
    ----------
    start_ns, end_ns
        From the first, up to but not including the second.
    max_spectra
        Of more than these, some that lie evenly in time are read.
    """

    unit: str
    bearing: str
    start_ns: int
    end_ns: int
    max_spectra: int


@dataclass(frozen=True, eq=False)
class StoredSpectrum:
    """Averaged spectra of the channels of a bearing.

    Parameters
    ----------
    time_ns
        End of the samples.
    duration_s
        Of all the samples that were averaged.
    n_segments
        In which all channels were usable.
    quality
        The worst of the 1× amplitudes.
    bin_hz
        Frequency of the first line, and distance of the lines.
    amplitude_um_pk : (N_CHANNELS, n_lines)
        Displacement; NaN throughout where a channel was not usable.
    """

    time_ns: int
    duration_s: float
    n_segments: int
    state: OperatingState
    quality: Quality
    speed_rpm: float | None
    power_mw: float | None
    order1_hz: float | None
    vortex_hz: float | None
    bin_hz: float
    amplitude_um_pk: FloatArray

    @property
    def resolution(self) -> tuple[float, int]:
        """Distance and number of the lines; spectra that differ in it have no common axis."""
        return self.bin_hz, self.amplitude_um_pk.shape[1]


@dataclass(frozen=True, eq=False)
class Spectra:
    """Spectra of one bearing, oldest first.

    Parameters
    ----------
    n_found
        In the range asked for, before some were chosen.
    damaged_ns
        Times of those among the chosen whose checksum is wrong; they are left out.
    first_ns
        Time of the oldest that is kept of this bearing, in the range or not.
    """

    spectra: Sequence[StoredSpectrum]
    n_found: int
    damaged_ns: Sequence[int]
    first_ns: int | None


class SpectraStore(Protocol):
    """Reads what `append` has kept of the spectra of assessments."""

    def read(self, query: SpectraQuery) -> Spectra:
        """Read spectra of one bearing."""
        ...
