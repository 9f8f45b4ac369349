"""The history of alarms as a table: a row for each event."""

from collections.abc import Sequence

from core.condition.cells import CellGrid
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


RAISED_AT: dict[str, tuple[ColumnKind, str | None]] = {
    "operating_state": ("text", None),
    "eccentricity_ratio": ("number", "1"),
    "attitude_deg": ("number", "deg"),
    "oil_temperature_c": ("number", "°C"),
}
"""Columns of the condition under which an occurrence was raised, with their units."""


def event_table(events: Sequence[StoredEvent], grid: CellGrid) -> list[Column]:
    """Columns as the fields of the JSON answer; times in the column ``time_utc``."""
    rows = [event_model(stored, grid) for stored in events]
    times = Column("time_utc", "time", [stored.event.time_ns for stored in events])
    flat = [name for name in AlarmEventModel.model_fields if name not in ("time", "raised_at")]
    points = [row.raised_at for row in rows]
    return [
        times,
        *(_column(name, rows) for name in flat),
        *(
            Column(name, kind, [point and getattr(point, name) for point in points], unit)
            for name, (kind, unit) in RAISED_AT.items()
        ),
    ]


def _column(name: str, rows: Sequence[AlarmEventModel]) -> Column:
    return Column(name, KINDS.get(name, "text"), [getattr(row, name) for row in rows])
