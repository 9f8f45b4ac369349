"""Readings out of the store, as a file that a back-test takes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from core.baseline.history import DIRECTIONS, ReadingOutcome
from core.condition.operating_state import OperatingState
from core.machine.unit import Estimator
from core.units import DAY_NS
from service.cli.offline.back_test.file_columns import AMPLITUDES, PER_BEARING, SILENT
from service.cli.offline.back_test.histories import Place
from service.store.film_port import FilmHistory, FilmQuery, FilmStore

AT_ONCE_NS = 90 * DAY_NS
"""Of one film, so that memory does not depend on how many years are stored."""

SUFFIXES = (".csv", ".parquet")
QUALITY = {
    ReadingOutcome.MEASURED: "good",
    ReadingOutcome.INSUFFICIENT_EXCITATION: SILENT,
    ReadingOutcome.BAD_QUALITY: "bad",
}


def stored_histories(
    films: FilmStore, place: Place, estimator: Estimator, start_ns: int, end_ns: int
) -> Iterator[FilmHistory]:
    """Read the readings of one film, oldest first, a few months at a time."""
    first_ns = films.first_ns(*place, estimator)
    if first_ns is None:
        return
    begin_ns = max(first_ns, start_ns)
    for part_ns in range(begin_ns, end_ns, AT_ONCE_NS):
        until_ns = min(part_ns + AT_ONCE_NS, end_ns)
        found = films.history(FilmQuery(*place, estimator, part_ns, until_ns))
        if len(found):
            yield found


def table_of(place: Place, found: FilmHistory) -> Any:
    """Rows of both directions."""
    return pa.concat_tables(_side(place, found, side) for side in range(len(DIRECTIONS)))


def _side(place: Place, found: FilmHistory, side: int) -> Any:
    history, n = found.history, len(found)
    states = np.array([state.name.lower() for state in OperatingState])
    qualities = np.array([QUALITY[evidence] for evidence in ReadingOutcome])
    numbers = {
        "k_n_per_m": np.exp(history.ln_k[side]),
        "u_random": history.u_random[side],
        **{key: getattr(history, key) for key in PER_BEARING},
        **{key: getattr(history, key)[side] for key in AMPLITUDES},
    }
    return pa.table(
        {
            "time": pa.array(history.time_ns).cast(pa.timestamp("ns", tz="UTC")),
            "unit": [place[0]] * n,
            "bearing": [place[1]] * n,
            "direction": [DIRECTIONS[side]] * n,
            **{key: pa.array(column, from_pandas=True) for key, column in numbers.items()},
            "state": states[found.state],
            "quality": qualities[history.outcome[side]],
        }
    )


class ReadingsFile:
    """A CSV or Parquet file to be written; a context that leaves nothing behind if it fails.

    Parameters
    ----------
    path
        Whose suffix is one of `SUFFIXES`.

    Raises
    ------
    OSError
        If the file exists, or cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._writer: Any = None
        self._file = path.open("xb")

    def __enter__(self) -> "ReadingsFile":
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if self._writer is not None:
            self._writer.close()
        self._file.close()
        if kind is not None:
            self._path.unlink()

    def write(self, table: Any) -> None:
        """Add rows."""
        if self._writer is None:
            is_csv = self._path.suffix == ".csv"
            make: Any = pacsv.CSVWriter if is_csv else pq.ParquetWriter
            self._writer = make(self._file, table.schema)
        self._writer.write_table(table)
