"""Recordings from the formats that other tools write."""
