"""SQLite behind the store's interface."""

from service.store.sqlite.store import SqliteStore

__all__ = ["SqliteStore"]
