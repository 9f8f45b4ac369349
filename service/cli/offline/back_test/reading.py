"""A file of readings into one history per bearing."""

import re
import stat
from collections.abc import Callable, Collection, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from acquisition.recordings.confined import ConfinedProcess
from service.cli.offline.back_test.child import WRONG_FILE
from service.cli.offline.back_test.file_columns import LINE, TEXTS, ReadingsError
from service.cli.offline.back_test.histories import BearingRows, Place, histories_of
from service.cli.offline.back_test.parquet_rows import MAGIC
from service.cli.offline.back_test.problems import shown

MAX_NAMES = 2000
"""Different names in a column: 200 units of at most 8 bearings."""

IDENTIFIER = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")
"""Name of a unit or bearing, as in plant files."""


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
        return histories_of(_columns(path, word, advanced), places, word)
    except OSError as error:
        raise ReadingsError(f"{path}: {error.strerror}") from error
    except (ReadingsError, ValueError) as error:
        raise ReadingsError(f"{path}: {error}") from error


def _columns(path: Path, word: str, advanced: Callable[[int], object]) -> Mapping[str, Any]:
    module, file = "service.cli.offline.back_test.child", str(path.absolute())
    with closing(ConfinedProcess(module, file)) as process:
        try:
            gathered = _gathered(process, word, advanced)
        except (pa.ArrowException, OSError):
            raise ReadingsError(_why(process)) from None
        if process.exit_code() != 0:
            raise ReadingsError(_why(process))
    columns = {}
    for key in list(gathered):  # each is released as soon as it is joined
        parts = gathered.pop(key)
        if key in TEXTS:
            columns[key] = pa.chunked_array(parts).unify_dictionaries().combine_chunks()
        else:
            columns[key] = np.concatenate(parts)
    return columns


def _gathered(
    process: ConfinedProcess, word: str, advanced: Callable[[int], object]
) -> dict[str, list[Any]]:
    """Parts of each column: texts dictionary-encoded, numbers as numpy arrays."""
    reader = pa.ipc.open_stream(process.output)
    parts: dict[str, list[Any]] = {key: [] for key in reader.schema.names}
    names: dict[str, set[str]] = {key: set() for key in parts if key in TEXTS}
    before = 0
    try:
        while True:
            batch, metadata = reader.read_next_batch_with_custom_metadata()
            for key in parts:
                if key in names:
                    parts[key].append(pc.dictionary_encode(batch.column(key)))
                    _check_names(key, parts[key][-1], names[key], batch.column(LINE), word)
                else:
                    parts[key].append(batch.column(key).to_numpy().copy())
            n_bytes = int(metadata["n_bytes"])
            advanced(n_bytes - before)
            before = n_bytes
    except StopIteration:
        return parts


def _check_names(key: str, column: Any, names: set[str], line: Any, word: str) -> None:
    """Refuse names that no unit or bearing can have, and too many different ones."""
    for code, name in enumerate(column.dictionary.to_pylist()):
        if key in ("unit", "bearing") and not IDENTIFIER.fullmatch(name):
            row = int(np.argmax(column.indices.to_numpy() == code))
            raise ReadingsError(
                f"{word} {line[row]}: {key} {shown(name)} must be letters, digits, dot,"
                " dash or underscore, at most 32"
            )
        names.add(name)
    if len(names) > MAX_NAMES:
        raise ReadingsError(
            f"more than {MAX_NAMES} different names in column {key} up to {word} {line[-1]}"
        )


def _why(process: ConfinedProcess) -> str:
    words = process.last_words()
    return words if process.exit_code() == WRONG_FILE else f"not readable: {words}"
