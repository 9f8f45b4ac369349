"""Baseline and decision over years of readings in files: what would have been alarmed."""
