"""Simulated years of a unit's guide bearings: readings, and scenarios of single moments."""
