"""SQLite implementation of the store."""

from service.store.sqlite.store import SqliteStore

__all__ = ["SqliteStore"]
