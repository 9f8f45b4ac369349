"""Recordings of samples around alarms, as they lie on the disk."""
