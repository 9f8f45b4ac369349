"""Simulated plant for tests and demonstrations: machine, devices and years of readings."""
