"""Simulated measuring devices: any samples, served over the real protocols."""
