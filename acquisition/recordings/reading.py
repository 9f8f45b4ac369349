"""Foreign files read in a confined child process, as the process sees it that asks for them."""

import atexit
import json
import os
import select
import signal
import stat
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from acquisition.delivery.raw import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.confined import ConfinedProcess, printable
from acquisition.recordings.imports.job import ImportJob
from acquisition.recordings.messages import BlockLayout, FrameBatch, Message, frames_of, receive

SILENCE_S = 300.0
"""Longest time without a message before the child is taken for hung."""

_CHUNK_BYTES = 2**20
_ENVIRONMENT = {
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # others reserve address space, which is limited
    "HDF5_PLUGIN_PRELOAD": "::",  # no filters from libraries that a file names
    "OPENBLAS_NUM_THREADS": "1",  # each thread takes address space
}
_MAX_IDLE = 2
_idle: deque[ConfinedProcess] = deque()
"""Children without a request: starting one costs 0.2 s, a request to one some milliseconds."""


class ConfinedReader:
    """Answer of the child to one request; see :func:`confined_reader`.

    Attributes
    ----------
    has_ended
        Whether the child has sent its last message, and is ready for another request.
    """

    def __init__(self, process: ConfinedProcess, path: Path, format_: str) -> None:
        self._process, self._path, self._format = process, path, format_
        self._held = bytearray()
        self._is_silent = self.has_ended = False

    def request(self, request: Mapping[str, Any]) -> None:
        """Say what is to be read."""
        try:
            self._process.input.write(json.dumps(request).encode() + b"\n")
            self._process.input.flush()
        except BrokenPipeError:
            return  # the log of the child says why

    def messages(self, kind: str) -> Iterator[Message]:
        """All messages of this kind up to the end.

        Raises
        ------
        ConfigError
            If the file is refused; one sentence with its path.
        """
        while (message := self.message(kind, "end"))[0]["kind"] == kind:
            yield message
        self.has_ended = True

    def message(self, *kinds: str) -> Message:
        """The next message; raises as :meth:`messages`."""
        try:
            message = receive(self._read)
        except EOFError as error:
            raise self._broken_off() from error
        kind = message[0].get("kind")
        if kind == "error":
            self.has_ended = True
            words, number = str(message[0].get("message")), message[0].get("errno")
            cause = OSError(number, os.strerror(number)) if isinstance(number, int) else None
            raise ConfigError(printable(" ".join(words.split()), 1000)) from cause
        if kind not in kinds:
            raise ConfigError(f"{self._path}: an answer out of turn from the reading process")
        return message

    def _read(self, n_bytes: int) -> bytes:
        out = self._process.output.fileno()
        while len(self._held) < n_bytes:
            self._is_silent = not select.select([out], [], [], SILENCE_S)[0]
            more = b"" if self._is_silent else os.read(out, _CHUNK_BYTES)
            if not more:
                raise EOFError
            self._held += more
        found = bytes(self._held[:n_bytes])
        del self._held[:n_bytes]
        return found

    def _broken_off(self) -> ConfigError:
        if self._is_silent:
            words = f"nothing came out of it for {SILENCE_S:g} s"
        else:
            words = self._process.last_words()
        error = ConfigError(f"{self._path}: not readable as {self._format}: {words}")
        if not self._is_silent and self._process.exit_code() == -signal.SIGKILL:
            error.__cause__ = MemoryError()  # the system had none left: no fault of the file
        return error


@contextmanager
def confined_reader(
    path: Path, format_: str, request: Mapping[str, Any]
) -> Iterator[ConfinedReader]:
    """Begin to read a file or recording; leaving the context ends the reading.

    Raises
    ------
    ConfigError
        If it is refused; one sentence with its path.
    """
    try:
        process = _idle_or_new()
    except OSError as error:
        raise ConfigError(f"{path}: no process to read it: {error.strerror}") from error
    reader = ConfinedReader(process, path, format_)
    try:
        reader.request({"path": str(path.absolute()), "format": format_} | dict(request))
        yield reader
    finally:
        if reader.has_ended and len(_idle) < _MAX_IDLE:
            _idle.append(process)
        else:
            process.close()


def _idle_or_new() -> ConfinedProcess:
    while True:
        try:
            process = _idle.pop()
        except IndexError:
            return ConfinedProcess("acquisition.recordings.child", environment=_ENVIRONMENT)
        if process.is_running():
            process.clear_log()
            return process
        process.close()


def close_idle_children() -> None:
    """End the children that wait for another request."""
    while _idle:
        _idle.pop().close()


atexit.register(close_idle_children)


class ImportReader:
    """Blocks or frames of a file that is imported; see :func:`import_reader`.

    Attributes
    ----------
    sample_type
        "int16" or "float32"; empty for CAN logs.
    done
        Share of the file that has been read.
    """

    def __init__(self, reader: ConfinedReader, job: ImportJob) -> None:
        self._reader, self._job = reader, job
        self.done = 0.0
        self.sample_type = str(reader.message("start")[0].get("sample_type"))

    def blocks(self) -> Iterator[RawBlock]:
        """All blocks of a file of waveforms.

        Raises
        ------
        ConfigError
            If the file is refused; one sentence with its path.
        """
        layout = BlockLayout(len(self._job.channels), len(self._job.slow), self.sample_type)
        for message in self._messages("blocks"):
            for head, counts in layout.blocks(message):
                yield head.raw(self._job.rate_hz, counts)

    def frames(self) -> Iterator[FrameBatch]:
        """All frames of a CAN log; raises as :meth:`blocks`."""
        for message in self._messages("frames"):
            yield frames_of(message)

    def _messages(self, kind: str) -> Iterator[Message]:
        for message in self._reader.messages(kind):
            done = message[0].get("done")
            self.done = done if isinstance(done, float) and 0.0 <= done <= 1.0 else self.done
            yield message


@contextmanager
def import_reader(path: Path, job: ImportJob) -> Iterator[ImportReader]:
    """Begin to read a foreign file; leaving the context ends the reading.

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
    request = {"job": TypeAdapter(ImportJob).dump_python(job, mode="json")}
    with confined_reader(path, job.format, request) as reader:
        yield ImportReader(reader, job)
