"""Recordings of vibration samples, around alarms and continuous; their library and retention."""
