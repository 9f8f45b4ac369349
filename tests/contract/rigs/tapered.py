"""Samples tapered as a segment's are, for tests of single lines."""

from core.arrays import FloatArray
from core.spectra.lines import taper_weights


def tapered(samples: FloatArray) -> FloatArray:
    """Samples (n_channels, n_samples) without each channel's mean, times the taper."""
    return (samples - samples.mean(axis=1, keepdims=True)) * taper_weights(samples.shape[1])
