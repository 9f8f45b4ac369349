"""Whether a line carries enough of the machine's own motion to read a stiffness from."""

from dataclasses import dataclass

from core.quality import Reason
from core.spectra.cross_spectrum import CrossSpectrum
from core.spectra.lines import SegmentSettings

CHANCE = 1e-6
"""Probability with which noise alone may be as coherent as what a stiffness is read from."""

MAX_RUNOUT_SHARE = 0.25
"""Of the shaft's amplitude, beyond which runout hides its motion."""


def chance_coherence(n_segments: float) -> float:
    """Squared coherence that two independent noises exceed once in a million averages.

    Carter, Knapp and Nuttall (1973): without overlap, P(γ² > c) = (1 - c)^(n - 1).

    Parameters
    ----------
    n_segments
        Independent segments that are averaged, more than 1.
    """
    return float(1.0 - CHANCE ** (1.0 / (n_segments - 1.0)))


@dataclass(frozen=True)
class EvidenceSettings(SegmentSettings):
    """Also what counts as evidence of a stiffness.

    Parameters
    ----------
    min_coherence
        Squared coherence of shaft and bearing motion below which there is no stiffness. At 0.9, a
        bearing line that is noise to the rest makes equation (5) read 5 % high.
    min_coverage
        Share of the wanted segments below which a result is marked uncertain.
    """

    min_coherence: float = 0.9
    min_coverage: float = 0.5


def line_excitation(
    spectrum: CrossSpectrum,
    line: int,
    shaft: int,
    bearing: int,
    min_coherence: float = 0.9,
    runout_um_pk: float = 0.0,
) -> Reason:
    """Whether a line carries enough motion for `ratio` and `transfer`, else the reason.

    Parameters
    ----------
    min_coherence
        Least squared coherence of shaft and bearing motion.
    runout_um_pk
        Largest runout of the shaft's surface at this line that is not taken off; zero away from the
        harmonics of the running speed. It is as coherent as motion: only amplitude can tell.

    Returns
    -------
    OK, FEW_SEGMENTS or INSUFFICIENT_EXCITATION.
    """
    if spectrum.n_segments[shaft, bearing] < 2:
        return Reason.FEW_SEGMENTS  # one segment is coherent with anything
    shaft_um_pk = float(spectrum.amplitude_um_pk(shaft)[line])
    hidden = runout_um_pk > MAX_RUNOUT_SHARE * shaft_um_pk
    incoherent = spectrum.coherence_at(line, shaft, bearing) < min_coherence
    return Reason.INSUFFICIENT_EXCITATION if hidden or incoherent else Reason.OK
