"""One stretch of time, transformed once: lines, speed, vortex, orbit."""
