"""The plant HTTP API."""
