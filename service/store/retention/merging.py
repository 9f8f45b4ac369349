"""Late readings of hours whose single readings are gone: added to the roll-ups that there are."""

from service.store.database import Connection
from service.store.retention.marks import Gone
from service.store.rollups.making import forget_width, insert_cells, minutes_of, rolled_columns
from service.store.rollups.rows import HOUR_NS, select_cells, together

DELETE_READINGS = "DELETE FROM assessment WHERE series = ? AND time_ns >= ? AND time_ns < ?"


def merge_late(writer: Connection, series: int, hour_ns: int, gone: Gone) -> None:
    """Add the single readings of such an hour, all of them late, to its roll-ups; then they go.

    Both in one transaction: a reading is always in one of the two. One that is offered twice after
    its hour was deleted counts twice: nothing tells it from another any more.
    """
    hour = (hour_ns, hour_ns + HOUR_NS)
    minutes = minutes_of(writer, series, hour)
    if minutes is None:
        return
    for width_ns in gone.kept_ns(hour_ns):
        late = minutes.gathered(width_ns)
        before = select_cells(writer, series, width_ns, hour, rolled_columns())
        forget_width(writer, series, width_ns, hour)
        all_ = late if before is None else together(before, late).gathered(width_ns)
        insert_cells(writer, series, width_ns, all_)
    writer.execute(DELETE_READINGS, (series, *hour))
