"""The newest stored result of a bearing, with qualities as they were."""

from core.quality import Level, Quality, Reading, Reason
from service.store.codec import LEVEL_SHIFT, Layout
from service.store.database import Connection
from service.store.port import StoredReadings

SELECT_NEWEST = """
    SELECT time_ns, quantities, reasons, reading_values, reading_qualities
    FROM assessment JOIN layout ON layout.id = assessment.layout
    WHERE series = (SELECT id FROM series WHERE unit = ? AND bearing = ?)
    ORDER BY time_ns DESC LIMIT 1
"""


def select_newest(reader: Connection, unit: str, bearing: str) -> StoredReadings | None:
    """The readings with the latest time; None if there are none at all."""
    row = reader.execute(SELECT_NEWEST, (unit, bearing)).fetchone()
    if row is None:
        return None
    time_ns, quantities, reasons, values, qualities = row
    layout = Layout.loads(quantities, reasons)
    number, _ = layout.decode([values], [qualities])
    readings = {
        name: _reading(value, quality, layout)
        for name, value, quality in zip(
            layout.quantities, number[0].tolist(), qualities, strict=True
        )
        if "." not in name  # a column of an uncertainty
    }
    return StoredReadings(int(time_ns), readings)


def _reading(value: float, byte: int, layout: Layout) -> Reading:
    level = Level(byte >> LEVEL_SHIFT)
    quality = Quality(level, Reason(layout.reasons[byte & ((1 << LEVEL_SHIFT) - 1)]))
    return Reading(None if level is Level.BAD else value, quality)
