"""Recordings of samples on the disk: around alarms and continuous; their library and retention."""
