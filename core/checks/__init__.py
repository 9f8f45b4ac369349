"""Checks of transducers and signals."""
