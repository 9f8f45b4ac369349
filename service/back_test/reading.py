"""A file of readings into one history per bearing."""

import os
import signal
import stat
import subprocess
import sys
import tempfile
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import IO, Any

import pyarrow as pa

from core.history_rows import BearingRows, Place, histories_from_columns
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
    with tempfile.TemporaryFile() as log:
        command = [sys.executable, "-m", "service.back_test.child", str(path.absolute())]
        process = subprocess.Popen(  # noqa: S603  our own module
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=log,
            env=os.environ | _ENVIRONMENT | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )
        try:
            return _gathered(process, log, word, advanced)
        finally:
            process.kill()
            process.wait()
            if process.stdout is not None:
                process.stdout.close()


def _gathered(
    process: "subprocess.Popen[bytes]",
    log: IO[bytes],
    word: str,
    advanced: Callable[[int], object],
) -> Mapping[str, Any]:
    try:
        reader = pa.ipc.open_stream(process.stdout)
        gathered, before = Gathered(reader.schema, word), 0
        while True:
            batch, metadata = reader.read_next_batch_with_custom_metadata()
            gathered.add(batch)
            n_bytes = int(metadata["n_bytes"])
            advanced(n_bytes - before)
            before = n_bytes
    except StopIteration:
        pass
    except (pa.ArrowException, OSError):
        raise ReadingsError(_last_words(process, log)) from None
    if process.wait() != 0:
        raise ReadingsError(_last_words(process, log))
    return gathered.columns()


def _last_words(process: "subprocess.Popen[bytes]", log: IO[bytes]) -> str:
    code = process.wait()
    log.seek(0)
    said = _printable(log.read(2000).decode(errors="replace"))
    if code == WRONG_FILE:
        return " ".join(said)
    if code < 0:
        return f"not readable: the reading process ended by {signal.Signals(-code).name}"
    return f"not readable: {said[-1][:200] if said else 'no reason given'}"


def _printable(text: str) -> list[str]:
    """Lines as a terminal may have them: names in a file may be anything."""
    lines = text.strip().splitlines()
    return ["".join(c if c.isprintable() else "?" for c in line) for line in lines]
