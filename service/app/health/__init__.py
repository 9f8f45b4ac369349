"""The small HTTP server of processes without API and dashboard: is it alive, does it work."""
