"""Confined child process ``python -m acquisition.recordings.child``; requests on standard input.

Each request is one line of JSON. A fork with limits on memory, time and file size answers it with
:mod:`acquisition.recordings.messages`. A malicious file can affect only that fork.
"""

import importlib
import json
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from pydantic import TypeAdapter

from acquisition.errors import ConfigError
from acquisition.recordings import tables  # loaded once, before the forks
from acquisition.recordings.confined import confine, memory_in_use_bytes
from acquisition.recordings.imports.csv_file import csv_rows
from acquisition.recordings.imports.hdf5_file import hdf5_file
from acquisition.recordings.imports.job import ImportJob
from acquisition.recordings.imports.mdf_file import mdf_file
from acquisition.recordings.imports.rows import Rows, sample_blocks
from acquisition.recordings.imports.series import series_rows
from acquisition.recordings.imports.tdms_file import tdms_file
from acquisition.recordings.manifest import (
    BLOCKS,
    BLOCKS_PER_GROUP,
    ROWS_PER_GROUP,
    SAMPLES,
    Manifest,
)
from acquisition.recordings.messages import (
    FAILED,
    READY,
    Message,
    blocks_message,
    frames_message,
    heads_of,
    send,
)
from core.arrays import RawArray

_ROWS: Mapping[str, Callable[[Path, ImportJob], Iterator[Rows]]] = {
    "csv": csv_rows,
    "hdf5": lambda path, job: series_rows(hdf5_file(path), job),
    "tdms": lambda path, job: series_rows(tdms_file(path), job),
    "mdf4": lambda path, job: series_rows(mdf_file(path, job), job),
}

_LIBRARIES = {"hdf5": "h5py", "tdms": "nptdms", "mdf4": "asammdf", "candump": "can", "blf": "can"}
"""Libraries of formats; slow imports, not needed by a process that reads recordings alone."""


def main() -> None:
    """Answer requests, each in a fork, until standard input ends or a fork fails."""
    sys.stdout.buffer.write(READY)
    sys.stdout.buffer.flush()
    for line in sys.stdin.buffer:
        request = json.loads(line)
        if request["format"] in _LIBRARIES:
            with suppress(ImportError):  # the fork reports what is missing
                importlib.import_module(_LIBRARIES[request["format"]])  # once, before the forks
        child = os.fork()
        if child == 0:
            _answer_and_exit(request)
        code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if code < 0:
            with suppress(OSError):  # the action of SIGKILL cannot be set
                signal.signal(-code, signal.SIG_DFL)
            os.kill(os.getpid(), -code)
        elif code:
            sys.exit(code)
        send(sys.stdout.buffer, {"kind": "end"})  # only after the fork has closed the file
        sys.stdout.buffer.flush()


def _answer_and_exit(request: Mapping[str, Any]) -> None:
    code = 1
    try:
        confine(memory_in_use_bytes() + _memory_bytes(request))
        code = FAILED  # later exceptions are caused by the file
        answer(request, sys.stdout.buffer)
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)


def _memory_bytes(request: Mapping[str, Any]) -> int:
    """Return the memory limit in bytes; it is higher for formats without limits of their own."""
    return 2**31 if request["format"] in _ROWS else 2**28


def answer(request: Mapping[str, Any], out: BinaryIO) -> None:
    """Write the content of a file to `out` as messages; a rejected file ends with an error message.

    Parameters
    ----------
    request
        ``path`` and ``format``; for an import ``job``; for a recording ``manifest``, the range of
        blocks ``first`` to ``stop`` (excluded), and the flag ``samples`` to include the samples.
    """
    path = Path(request["path"])
    is_recording = request["format"] == "recording"
    try:
        for head, body in _recording(path, request) if is_recording else _import(path, request):
            send(out, head, body)
    except (ConfigError, MemoryError) as error:
        words, number = str(error), getattr(error.__cause__, "errno", None)
        if isinstance(error, MemoryError) or isinstance(error.__cause__, MemoryError):
            n_mib = _memory_bytes(request) >> 20
            words = f"reading requires more than {n_mib} MiB of memory; split the file"
        words = words if words.startswith(str(path)) else f"{path}: {words}"
        send(out, {"kind": "error", "message": words[:1000], "errno": number})
    out.flush()


def _import(path: Path, request: Mapping[str, Any]) -> Iterator[Message]:
    job = TypeAdapter(ImportJob).validate_python(request["job"])
    if job.format in ("candump", "blf"):
        from acquisition.recordings.imports.can_log import read_frames  # loads python-can

        for batch, done in read_frames(path, job):
            yield frames_message(batch, done)
    else:
        for block, done in sample_blocks(_ROWS[job.format](path, job), job):
            yield blocks_message(heads_of(block), (), block.counts, done)


def _recording(folder: Path, request: Mapping[str, Any]) -> Iterator[Message]:
    manifest = Manifest.model_validate(request["manifest"])
    first, stop = request["first"], request["stop"]
    samples, blocks = tables.samples_schema(manifest), tables.blocks_schema(manifest)
    with (
        tables.parquet_file(folder / SAMPLES, samples, manifest.n_samples, ROWS_PER_GROUP) as file,
        tables.parquet_file(folder / BLOCKS, blocks, manifest.n_blocks, BLOCKS_PER_GROUP) as heads,
    ):
        read = _counts_reader(file, manifest) if request["samples"] else None
        number = first_row = 0
        for rows, rejected in tables.read_heads(heads, len(manifest.slow_channels)):
            n_samples = rows["n_samples"]
            for start, end in _pieces(n_samples, max(0, first - number), stop - number):
                begin = first_row + int(n_samples[:start].sum())
                yield blocks_message(
                    rows[start:end],
                    [(row - start, why, n) for row, why, n in rejected if start <= row < end],
                    read(begin, int(n_samples[start:end].sum())) if read else None,
                )
            number, first_row = number + len(rows), first_row + int(n_samples.sum())
            if number >= stop:
                return


def _pieces(n_samples: Any, start: int, stop: int) -> Iterator[tuple[int, int]]:
    """Yield ranges of blocks, one per message: the whole range if short, else single blocks."""
    stop = min(stop, len(n_samples))
    if start < stop and n_samples[start:stop].sum() <= ROWS_PER_GROUP:
        yield start, stop
    else:
        yield from ((n, n + 1) for n in range(start, stop))


def _counts_reader(file: Any, manifest: Manifest) -> Callable[[int, int], RawArray]:
    """Return a reader (first row, number of rows) of samples, with one row group in memory."""
    group = lru_cache(maxsize=1)(partial(tables.read_counts, file))

    def read(first_row: int, n_rows: int) -> RawArray:
        stop = first_row + n_rows
        if stop > manifest.n_samples:
            raise ConfigError(
                f"the recording is damaged: its blocks have {stop} samples or more, but the"
                f" samples file has {manifest.n_samples}"
            )
        parts: list[Any] = [
            group(n)[:, max(0, first_row - n * ROWS_PER_GROUP) : stop - n * ROWS_PER_GROUP]
            for n in range(first_row // ROWS_PER_GROUP, (stop - 1) // ROWS_PER_GROUP + 1)
        ]
        return np.concatenate(parts, axis=1)

    return read


if __name__ == "__main__":
    main()
