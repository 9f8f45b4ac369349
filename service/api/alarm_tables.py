"""The history of alarms as a table: a row for each event."""

from collections.abc import Sequence

from service.api.alarm_models import AlarmEventModel
from service.api.alarm_views import event_model
from service.api.tables import Column, ColumnKind
from service.store.port import StoredEvent

KINDS: dict[str, ColumnKind] = {
    "id": "count",
    "number": "count",
    "occurrence": "count",
    "value": "number",
    "limit": "number",
}
"""Of columns that are no text."""


def event_table(events: Sequence[StoredEvent]) -> list[Column]:
    """Columns as the fields of the JSON answer; times in the column ``time_utc``."""
    rows = [event_model(stored) for stored in events]
    times = Column("time_utc", "time", [stored.event.time_ns for stored in events])
    return [
        times,
        *(_column(name, rows) for name in AlarmEventModel.model_fields if name != "time"),
    ]


def _column(name: str, rows: Sequence[AlarmEventModel]) -> Column:
    return Column(name, KINDS.get(name, "text"), [getattr(row, name) for row in rows])
