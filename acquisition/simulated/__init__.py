"""Simulated plant for tests and demonstrations: machine, devices, years of readings."""
