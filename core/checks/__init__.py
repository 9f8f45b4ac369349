"""Checks of transducers and of their signals."""
