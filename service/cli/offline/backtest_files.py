"""Files of readings: read for a back-test, or exported from the store."""

import re
import stat
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as pacsv
import pyarrow.parquet as pq

from acquisition.recordings.confined import ConfinedProcess
from core.baseline.history import DIRECTIONS, ReadingOutcome
from core.condition.operating_state import OperatingState
from core.machine.unit import Estimator
from core.units import DAY_NS
from service.cli.offline.backtest_cells import (
    AMPLITUDES,
    LINE,
    PER_BEARING,
    SILENT,
    TEXTS,
    ReadingsError,
    shown,
)
from service.cli.offline.backtest_histories import BearingRows, Place, histories_of
from service.cli.offline.backtest_tables import MAGIC, WRONG_FILE
from service.store.film_readings import FilmHistory, FilmQuery
from service.store.films import FilmStore

MAX_NAMES = 2000
"""Maximum number of different names in a column: 200 units of at most 8 bearings."""

IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")
"""Name of a unit or bearing, as in plant files."""


def read_histories(
    path: Path,
    places: Collection[Place] | None = None,
    advanced: Callable[[int], object] = lambda _: None,
) -> dict[Place, BearingRows]:
    """Read the readings of all bearings from a CSV or Parquet file, by unit and bearing.

    Parameters
    ----------
    places
        Pairs of unit and bearing that exist, others are an error; None allows all.
    advanced
        Called with the number of bytes read since the last call.

    Raises
    ------
    ReadingsError
        If the file is invalid; the message names lines (CSV) or rows (Parquet), counted from 1.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ReadingsError("not a regular file; give a CSV or Parquet file")
        with path.open("rb") as stream:
            word = "row" if stream.read(len(MAGIC)) == MAGIC else "line"
        return histories_of(_columns(path, word, advanced), places, word)
    except OSError as error:
        raise ReadingsError(f"{path}: {error.strerror}") from error
    except ReadingsError as error:
        raise ReadingsError(f"{path}: {error}") from error


def _columns(path: Path, word: str, advanced: Callable[[int], object]) -> Mapping[str, Any]:
    module, file = "service.cli.offline.backtest_tables", str(path.absolute())
    with closing(ConfinedProcess(module, file)) as process:
        try:
            gathered = _gathered(process, word, advanced)
        except (pa.ArrowException, OSError):
            raise ReadingsError(_why(process)) from None
        if process.exit_code() != 0:
            raise ReadingsError(_why(process))
    columns = {}
    for key in list(gathered):  # parts are released as soon as they are joined
        parts = gathered.pop(key)
        if key in TEXTS:
            columns[key] = pa.chunked_array(parts).unify_dictionaries().combine_chunks()
        else:
            columns[key] = np.concatenate(parts)
    return columns


def _gathered(
    process: ConfinedProcess, word: str, advanced: Callable[[int], object]
) -> dict[str, list[Any]]:
    """Return parts of each column: texts dictionary-encoded, numbers as numpy arrays."""
    reader = pa.ipc.open_stream(process.output)
    parts: dict[str, list[Any]] = {key: [] for key in reader.schema.names}
    names: dict[str, set[str]] = {key: set() for key in parts if key in TEXTS}
    before = 0
    for batch, metadata in reader.iter_batches_with_custom_metadata():
        for key in parts:
            if key in names:
                parts[key].append(pc.dictionary_encode(batch.column(key)))
                _check_names(key, parts[key][-1], names[key], batch.column(LINE), word)
            else:
                parts[key].append(batch.column(key).to_numpy().copy())
        n_bytes = int(metadata["n_bytes"])
        advanced(n_bytes - before)
        before = n_bytes
    return parts


def _check_names(key: str, column: Any, names: set[str], line: Any, word: str) -> None:
    for code, name in enumerate(column.dictionary.to_pylist()):
        if key in ("unit", "bearing") and not IDENTIFIER.fullmatch(name):
            row = int(np.argmax(column.indices.to_numpy() == code))
            raise ReadingsError(
                f"{word} {line[row]}: {key} {shown(name)} must be 1 to 32 letters, digits, dots,"
                " dashes or underscores"
            )
        names.add(name)
    if len(names) > MAX_NAMES:
        raise ReadingsError(
            f"more than {MAX_NAMES} names in column {key} up to {word} {line[-1]}; check the column"
        )


def _why(process: ConfinedProcess) -> str:
    words = process.last_words()
    return words if process.exit_code() == WRONG_FILE else f"the file cannot be read: {words}"


AT_ONCE_NS = 90 * DAY_NS
"""Time span read at once, so that memory does not depend on the number of years stored."""

SUFFIXES = (".csv", ".parquet")
QUALITY = {
    ReadingOutcome.MEASURED: "good",
    ReadingOutcome.INSUFFICIENT_EXCITATION: SILENT,
    ReadingOutcome.BAD_QUALITY: "bad",
}


def stored_histories(
    films: FilmStore, place: Place, estimator: Estimator, start_ns: int, end_ns: int
) -> Iterator[FilmHistory]:
    """Yield the stored readings of a bearing in parts of 90 days, oldest first.

    `place` is the pair of unit and bearing. The readings are those from `start_ns` on, before
    `end_ns`, both ns since 1970 UTC. Raises `StoreError` if the store cannot be read.
    """
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
    """Return film readings as an Arrow table with the rows of direction x, then of y.

    The columns are those of a file of readings; NaN becomes null. `place` is unit and bearing.
    """
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


@contextmanager
def readings_file(path: Path) -> Iterator[Callable[[Any], None]]:
    """Create a CSV file (suffix ".csv") or Parquet file; yield a function that appends rows.

    The function takes a `pyarrow.Table`. The first table determines the columns; without a table
    the file stays empty. An error in the block removes the file.

    Raises
    ------
    OSError
        If the file exists, or cannot be written.
    """
    make: Any = pacsv.CSVWriter if path.suffix == ".csv" else pq.ParquetWriter
    with path.open("xb") as file, ExitStack() as stack:
        writers: list[Any] = []

        def write(table: Any) -> None:
            if not writers:
                writers.append(stack.enter_context(make(file, table.schema)))
            writers[0].write_table(table)

        try:
            yield write
        except BaseException:
            path.unlink()
            raise
