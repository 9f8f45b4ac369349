"""The newest results, and how far they reach."""

from core.quality import Level, Quality, Reading, Reason
from core.samples.gaps import Gap, Reach
from service.store.database import Connection
from service.store.port import StoredReadings
from service.store.series import LEVEL_SHIFT, Layout

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


SELECT_SERIES = "SELECT id FROM series WHERE unit = ?"
SELECT_LAST = """
    SELECT time_ns, epoch, stop_index FROM assessment
    WHERE series = ? ORDER BY time_ns DESC LIMIT 1
"""
SELECT_BEHIND = """
    SELECT epoch, first_index, n_samples, stop_ns, start_ns, is_estimated FROM gap
    WHERE unit = ? AND epoch = ? AND first_index >= ? ORDER BY first_index
"""


def select_reach(reader: Connection, unit: str) -> Reach | None:
    """Up to where results reach, and the gaps behind that; None if there are no measured ones."""
    newest = [
        tuple(row)
        for (series,) in reader.execute(SELECT_SERIES, (unit,)).fetchall()
        if (row := reader.execute(SELECT_LAST, (series,)).fetchone()) is not None
    ]
    time_ns, epoch, stop_index = max(newest, default=(0, 0, 0))
    if not stop_index:  # as of a simulated past, which has no samples
        return None
    behind = reader.execute(SELECT_BEHIND, (unit, epoch, stop_index))
    return Reach(epoch, stop_index, time_ns, tuple(gap_of(row) for row in behind))


def gap_of(row: tuple[int, int, int, int, int | None, int]) -> Gap:
    """A gap as it is stored."""
    epoch, first_index, n_samples, stop_ns, start_ns, is_estimated = row
    return Gap(epoch, first_index, n_samples, stop_ns, start_ns, bool(is_estimated))
