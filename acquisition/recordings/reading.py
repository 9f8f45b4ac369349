"""Foreign files read in a confined child process, as the process sees it that asks for them."""

import atexit
import errno
import json
import os
import select
import signal
import stat
from collections import deque
from collections.abc import Generator, Iterator, Mapping
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from acquisition.delivery.calibration import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings.confined import ConfinedProcess, printable
from acquisition.recordings.imports.job import ImportJob
from acquisition.recordings.messages import (
    FAILED,
    READY,
    BlockLayout,
    Frames,
    Message,
    frames_of,
    receive,
)

SILENCE_S = 300.0
"""Longest time without a message before the child is taken for hung."""

_CHUNK_BYTES = 2**20
_ENVIRONMENT = {
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # others reserve address space, which is limited
    "HDF5_PLUGIN_PRELOAD": "::",  # no filters from libraries that a file names
    "OPENBLAS_NUM_THREADS": "1",  # each thread takes address space
}
_SIGNALS_OF_FAULTS = {
    signal.SIGABRT,
    signal.SIGBUS,
    signal.SIGFPE,
    signal.SIGILL,
    signal.SIGSEGV,
    signal.SIGXCPU,
}
"""Signals that a file can bring about; another one comes from the system or an operator."""

_MAX_IDLE = 2
_idle: deque[ConfinedProcess] = deque()
"""Children without a request: starting one costs 0.2 s, a request to one some milliseconds."""


def confined_messages(
    path: Path, format_: str, kind: str, request: Mapping[str, Any]
) -> Generator[Message]:
    """Read a file or recording in the child; closing the generator ends the reading.

    Parameters
    ----------
    format_
        As :func:`acquisition.recordings.child.answer` has it.
    kind
        Of the messages that are expected.

    Raises
    ------
    ConfigError
        If the file is refused; one sentence with its path.
    """
    try:
        process = _idle_or_new()
    except OSError as error:
        raise ConfigError(f"{path}: no process to read it: {error.strerror}") from error
    pipe, has_ended, refusal = _Pipe(process), False, None
    try:
        pipe.ask({"path": str(path.absolute()), "format": format_} | dict(request))
        while True:
            message = receive(pipe.read)
            found = message[0].get("kind")
            has_ended = found == "end"
            if has_ended and refusal is not None:
                raise refusal
            if has_ended:
                return
            if found == "error":
                refusal = _refusal(message[0])
            elif found == kind:
                yield message
            else:
                raise ConfigError(f"{path}: an answer out of turn from the reading process")
    except EOFError as error:
        reason, cause = pipe.why_broken()
        words = f"{path}: not readable as {format_}: {reason}"
        raise ConfigError(words) from cause or error
    finally:
        if has_ended and len(_idle) < _MAX_IDLE:
            _idle.append(process)
        else:
            process.close()


class _Pipe:
    """The pipes to and from a child."""

    def __init__(self, process: ConfinedProcess) -> None:
        self._process, self._out = process, process.output.fileno()
        self._readable = select.poll()  # not select(), which stops at 1024 open files
        self._readable.register(self._out, select.POLLIN)
        self._held = bytearray()
        self._is_silent = False

    def ask(self, request: Mapping[str, Any]) -> None:
        """Write a request."""
        try:
            self._process.input.write(json.dumps(request).encode() + b"\n")
            self._process.input.flush()
        except BrokenPipeError:
            return  # the log of the child has the reason

    def read(self, n_bytes: int) -> bytes:
        """Exactly this many bytes; raises EOFError if the child ends or falls silent before."""
        while len(self._held) < n_bytes:
            self._is_silent = not self._readable.poll(SILENCE_S * 1000)
            more = b"" if self._is_silent else os.read(self._out, _CHUNK_BYTES)
            if not more:
                raise EOFError
            self._held += more
        found = bytes(self._held[:n_bytes])
        del self._held[:n_bytes]
        return found

    def why_broken(self) -> tuple[str, OSError | None]:
        """Why there is no more to read, and the cause if it is not the file."""
        if self._is_silent:
            words = f"no answer for {SILENCE_S:g} s"
            return words, TimeoutError(errno.ETIMEDOUT, os.strerror(errno.ETIMEDOUT))
        words, code = self._process.last_words(), self._process.exit_code()
        if code == FAILED or -code in _SIGNALS_OF_FAULTS:
            return words, None
        return words, InterruptedError(errno.EINTR, os.strerror(errno.EINTR))


def _refusal(head: Mapping[str, Any]) -> ConfigError:
    words, number = str(head.get("message")), head.get("errno")
    error = ConfigError(printable(" ".join(words.split()), 1000))
    error.__cause__ = OSError(number, os.strerror(number)) if isinstance(number, int) else None
    return error


def _idle_or_new() -> ConfinedProcess:
    while True:
        try:
            process = _idle.pop()
        except IndexError:
            return _started()
        if process.is_running():
            process.clear_log()
            return process
        process.close()


def _started() -> ConfinedProcess:
    process = ConfinedProcess("acquisition.recordings.child", environment=_ENVIRONMENT)
    if not process.output.read(len(READY)):
        words = process.last_words()
        process.close()
        raise OSError(errno.ENOEXEC, words)
    return process


def close_idle_children() -> None:
    """End the children that wait for another request."""
    while _idle:
        _idle.pop().close()


atexit.register(close_idle_children)


def imported_blocks(path: Path, job: ImportJob) -> Generator[tuple[RawBlock, float]]:
    """All blocks of a foreign file of waveforms, each with the share of the file read so far.

    Raises
    ------
    ConfigError
        If there is no such file, or the job does not describe it; one sentence with its path.
    """
    layout = BlockLayout(len(job.channels), len(job.slow))
    for message in _imported(path, job, "blocks"):
        for head, counts in layout.blocks(message):
            yield head.raw(job.rate_hz, counts), _done(message)


def imported_frames(path: Path, job: ImportJob) -> Generator[tuple[Frames, float]]:
    """All frames of a CAN log in batches; share and errors as of :func:`imported_blocks`."""
    for message in _imported(path, job, "frames"):
        yield frames_of(message), _done(message)


def _imported(path: Path, job: ImportJob, kind: str) -> Iterator[Message]:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ConfigError(f"{path}: not a regular file")
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    request = {"job": TypeAdapter(ImportJob).dump_python(job, mode="json")}
    yield from confined_messages(path, job.format, kind, request)


def _done(message: Message) -> float:
    done = message[0].get("done")
    return min(max(done, 0.0), 1.0) if isinstance(done, float) else 0.0
