"""A trail on a real file, and deeds to put into it."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from rigs.database_copy import copy_database

from service.store.access.audit_entries import AuditAction, Source
from service.store.sqlite import SqliteStore

T0 = 1_767_225_600_000_000_000


@pytest.fixture
def deed() -> Callable[..., AuditAction]:
    """Builds deeds."""

    def build(n: int = 0, **changes: object) -> AuditAction:
        arguments: dict[str, object] = {
            "time_ns": T0 + n * 1_000_000_007,
            "actor": "A. Name",
            "action": "alarm.shelved",
            "object": f"U1:UJB:shaft_x:{n}",
            "before": {"state": "normal"},
            "after": {"state": "shelved", "until_s": 2.5, "by": "Ünïcode"} if n % 3 else None,
            "reason": "cable" if n % 2 else "",
            "source": Source.API,
            "peer": "192.0.2.7" if n % 2 else None,
        }
        return AuditAction(**{**arguments, **changes})  # type: ignore[arg-type]

    return build


@pytest.fixture
def store(database_file: Path, path: Path) -> Iterator[SqliteStore]:
    """An open, empty store."""
    opened = SqliteStore(copy_database(database_file, path.parent))
    yield opened
    opened.close()
