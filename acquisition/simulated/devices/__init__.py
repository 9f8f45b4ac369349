"""Simulated measuring devices: sample feeds served over real protocols."""
