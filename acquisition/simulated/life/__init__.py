"""Simulated years of the guide bearings of a unit: readings, and scenarios at given times."""
