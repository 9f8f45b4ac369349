"""PostgreSQL implementation of the store."""

from service.store.postgres.store import PostgresStore

__all__ = ["PostgresStore"]
