"""`Reading`: a foreign file, read by a process of its own that may fail in any way it likes."""

import os
import select
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pydantic import TypeAdapter

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.confined import ReadingProcess, printable, reading_process
from acquisition.recordings.frames import FrameBatch
from acquisition.recordings.imports.job import ImportJob
from acquisition.recordings.stream import Message, block_of, frames_of, receive

SILENCE_S = 300.0
"""Longest that a file may be worked on without a block coming out."""

_CHUNK = 2**20
_ENVIRONMENT = {
    "HDF5_PLUGIN_PRELOAD": "::",  # no filters out of libraries that a file names
    "OPENBLAS_NUM_THREADS": "1",  # each thread takes address space, which is limited
}


class Reading:
    """What the reading process finds; see :func:`reading`.

    Attributes
    ----------
    sample_type
        "int16" or "float32"; empty for CAN logs.
    done
        Share of the file that has been read.
    """

    def __init__(self, process: "_Process", path: Path, job: ImportJob) -> None:
        self._process, self._path, self._job = process, path, job
        self.done = 0.0
        self.sample_type = str(self._message("start")[0].get("sample_type"))

    def blocks(self) -> Iterator[RawBlock]:
        """All blocks of a file of waveforms.

        Raises
        ------
        ConfigError
            If the file is not what it should be; one sentence with its path.
        """
        n_channels = len(self._job.channels)
        for message in self._messages("block"):
            yield block_of(message, self._job.rate_hz, n_channels, self.sample_type)

    def frames(self) -> Iterator[FrameBatch]:
        """All frames of a CAN log.

        Raises
        ------
        ConfigError
            As :meth:`blocks`.
        """
        for message in self._messages("frames"):
            yield frames_of(message)

    def _messages(self, kind: str) -> Iterator[Message]:
        while (message := self._message(kind, "end"))[0]["kind"] == kind:
            done = message[0].get("done")
            self.done = done if isinstance(done, float) and 0.0 <= done <= 1.0 else self.done
            yield message

    def _message(self, *kinds: str) -> Message:
        try:
            message = receive(self._process.read)
        except EOFError as error:
            words = f"not readable as {self._job.format}: {self._process.last_words()}"
            raise ConfigError(f"{self._path}: {words}") from error
        kind = message[0].get("kind")
        if kind == "error":
            words = " ".join(str(message[0].get("message")).split())
            raise ConfigError(f"{self._path}: {printable(words)}")
        if kind not in kinds:
            raise ConfigError(f"{self._path}: an answer out of turn from the reading process")
        return message


@contextmanager
def reading(path: Path, job: ImportJob) -> Iterator[Reading]:
    """Begin to read a file; leaving the context ends the reading process.

    Raises
    ------
    ConfigError
        If there is no such file, or it is not what the job says; one sentence with its path.
    """
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ConfigError(f"{path}: not a regular file")
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    with reading_process("acquisition.recordings.child", path, _ENVIRONMENT) as process:
        child = _Process(process)
        child.start(TypeAdapter(ImportJob).dump_json(job))
        yield Reading(child, path, job)


class _Process:
    """The pipe from the reading process."""

    def __init__(self, process: ReadingProcess) -> None:
        self._process = process
        self._held = bytearray()
        self._is_silent = False

    def start(self, job: bytes) -> None:
        try:
            self._process.job.write(job)
            self._process.job.close()
        except BrokenPipeError:
            return  # its last words say why

    def read(self, n_bytes: int) -> bytes:
        """Just so many bytes; raises EOFError if the process ends or falls silent before."""
        out = self._process.found.fileno()
        while len(self._held) < n_bytes:
            self._is_silent = not select.select([out], [], [], SILENCE_S)[0]
            more = b"" if self._is_silent else os.read(out, _CHUNK)
            if not more:
                raise EOFError
            self._held += more
        found = bytes(self._held[:n_bytes])
        del self._held[:n_bytes]
        return found

    def last_words(self) -> str:
        """Why it ended, in one line."""
        if self._is_silent:
            return f"nothing came out of it for {SILENCE_S:g} s"
        return self._process.last_words()
