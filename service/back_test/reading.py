"""A file of readings into one history per bearing."""

import stat
from collections.abc import Callable, Collection, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import pyarrow as pa

from acquisition.recordings.confined import ConfinedProcess
from core.baseline.history_rows import BearingRows, Place, histories_from_columns
from service.back_test.child import WRONG_FILE
from service.back_test.coded import Gathered
from service.back_test.file_columns import LINE, ReadingsError
from service.back_test.parquet_rows import MAGIC

_ENVIRONMENT = {"ARROW_DEFAULT_MEMORY_POOL": "system", "OPENBLAS_NUM_THREADS": "1"}
"""Others take much address space, which is limited."""


def read_histories(
    path: Path,
    places: Collection[Place] | None = None,
    advanced: Callable[[int], object] = lambda _: None,
) -> dict[Place, BearingRows]:
    """Read a CSV or Parquet file.

    Parameters
    ----------
    places
        Units and bearings that there are; any, if not given.
    advanced
        Told how many more bytes of the file have been read.

    Raises
    ------
    ReadingsError
        If anything in it is wrong, with file and lines (CSV) or rows (Parquet), counted from 1.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ReadingsError("not a regular file")
        with path.open("rb") as stream:
            word = "row" if stream.read(len(MAGIC)) == MAGIC else "line"
        columns = dict(_columns(path, word, advanced))
        return histories_from_columns(columns, places, columns.pop(LINE), word)
    except OSError as error:
        raise ReadingsError(f"{path}: {error.strerror}") from error
    except (ReadingsError, ValueError) as error:
        raise ReadingsError(f"{path}: {error}") from error


def _columns(path: Path, word: str, advanced: Callable[[int], object]) -> Mapping[str, Any]:
    module, file = "service.back_test.child", str(path.absolute())
    with closing(ConfinedProcess(module, file, environment=_ENVIRONMENT)) as process:
        try:
            gathered = _gathered(process, word, advanced)
        except (pa.ArrowException, OSError):
            raise ReadingsError(_why(process)) from None
        if process.exit_code() != 0:
            raise ReadingsError(_why(process))
        return gathered.columns()


def _gathered(process: ConfinedProcess, word: str, advanced: Callable[[int], object]) -> Gathered:
    reader = pa.ipc.open_stream(process.output)
    gathered, before = Gathered(reader.schema, word), 0
    try:
        while True:
            batch, metadata = reader.read_next_batch_with_custom_metadata()
            gathered.add(batch)
            n_bytes = int(metadata["n_bytes"])
            advanced(n_bytes - before)
            before = n_bytes
    except StopIteration:
        return gathered


def _why(process: ConfinedProcess) -> str:
    words = process.last_words()
    return words if process.exit_code() == WRONG_FILE else f"not readable: {words}"
