"""Recordings of samples, around alarms and continuous; recording library and retention."""
