"""Samples around an alarm, kept as recordings in the data folder."""
