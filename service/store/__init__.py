"""Durable trends: one interface, one back end so far (SQLite)."""
