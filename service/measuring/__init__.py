"""Acquisition, analysis, alarms and storage of results; no HTTP."""
