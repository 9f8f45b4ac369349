"""Evidence required for a stiffness at a spectral line: coherence and excitation."""

from core.quality import Reason
from core.spectra.cross_spectrum import CrossSpectrum

CHANCE = 1e-6
"""Probability that independent noise reaches the coherence of `chance_coherence`."""

MAX_RUNOUT_SHARE = 0.25
"""Largest runout in a line as a fraction of the shaft's amplitude, for a usable shaft motion."""


def chance_coherence(n_segments: float) -> float:
    """Return the squared coherence that independent noise exceeds in one of a million averages.

    Carter, Knapp and Nuttall (1973): without overlap, P(γ² > c) = (1 - c)^(n - 1) for n > 1
    independent segments.
    """
    return float(1.0 - CHANCE ** (1.0 / (n_segments - 1.0)))


def line_excitation(
    spectrum: CrossSpectrum,
    line: int,
    shaft: int,
    bearing: int,
    min_coherence: float = 0.9,
    runout_um_pk: float = 0.0,
) -> Reason:
    """Return OK if a line has enough motion for equation (5) and `transfer`, else the reason.

    Parameters
    ----------
    spectrum, line
        Cross-spectrum, and the index of the line in it.
    shaft, bearing
        Indices of the two compared channels in the spectrum.
    min_coherence
        Smallest squared coherence of shaft and bearing motion.
    runout_um_pk
        Largest shaft runout contained in this line; zero off the harmonics of the running speed.
        Coherence does not reveal runout, so its amplitude is compared with the shaft's.

    Returns
    -------
    OK, FEW_SEGMENTS or INSUFFICIENT_EXCITATION.
    """
    if spectrum.n_segments[shaft, bearing] < 2:
        return Reason.FEW_SEGMENTS  # the coherence of one segment is always 1
    shaft_um_pk = float(spectrum.amplitude_um_pk(shaft)[line])
    hidden = runout_um_pk > MAX_RUNOUT_SHARE * shaft_um_pk
    incoherent = spectrum.coherence_at(line, shaft, bearing) < min_coherence
    return Reason.INSUFFICIENT_EXCITATION if hidden or incoherent else Reason.OK
