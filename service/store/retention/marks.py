"""Up to when what is fine was deleted."""

from dataclasses import dataclass
from itertools import pairwise

from service.store.database import Connection
from service.store.rollups.rows import NS_PER_S, WIDTHS_NS

SINGLE_S = 0
"""Stands for single readings among the widths."""

SELECT = "SELECT width_s, until_ns FROM retention_mark WHERE series = ?"
SET = """
    INSERT INTO retention_mark VALUES (?, ?, ?)
    ON CONFLICT (series, width_s) DO UPDATE SET until_ns = excluded.until_ns
"""


@dataclass(frozen=True)
class Gone:
    """What there is no more of a bearing.

    Parameters
    ----------
    until_ns
        By width, 0 for single readings: everything from before was deleted, or was never there.
    """

    until_ns: dict[int, int]

    @property
    def readings_ns(self) -> int:
        """Up to when single readings are gone; 0 if none are."""
        return self.of(SINGLE_S)

    def of(self, width_s: int) -> int:
        """Up to when roll-ups of a width are gone."""
        return self.until_ns.get(width_s, 0)

    def kept_ns(self, time_ns: int) -> tuple[int, ...]:
        """Widths of roll-ups that are there for a time, finest first."""
        return tuple(width for width in WIDTHS_NS if self.of(width // NS_PER_S) <= time_ns)

    def finest_ns(self, start_ns: int) -> int | None:
        """Width that everything since a time is there in; None if single readings are."""
        return self.kept_ns(start_ns)[0] if start_ns < self.readings_ns else None

    def stretches(self, span: tuple[int, int]) -> list[tuple[int, int]]:
        """A span of time, cut where something else is there."""
        cuts = sorted({*span, *(t for t in self.until_ns.values() if span[0] < t < span[1])})
        return list(pairwise(cuts))


def select_gone(reader: Connection, series: int) -> Gone:
    """What was deleted of a bearing."""
    return Gone({int(width): int(until) for width, until in reader.execute(SELECT, (series,))})


def set_gone(writer: Connection, series: int, width_s: int, until_ns: int) -> None:
    """Note that something was deleted, in the same transaction."""
    writer.execute(SET, (series, width_s, until_ns))
