"""Acquisition, analysis, alarms and storage of results; the HTTP interface is elsewhere."""
