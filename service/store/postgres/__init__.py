"""PostgreSQL behind the store's interface."""

from service.store.postgres.store import PostgresStore

__all__ = ["PostgresStore"]
