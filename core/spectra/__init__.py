"""Spectral analysis of sample segments: lines, speed, vortex, orbit."""
