"""Plausibility checks of transducers and of their signals."""
