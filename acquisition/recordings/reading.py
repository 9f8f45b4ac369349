"""Client of the confined child process that reads files; returns their blocks and CAN frames."""

import atexit
import errno
import json
import os
import signal
import stat
from collections import deque
from collections.abc import Generator, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from acquisition.errors import ConfigError
from acquisition.recordings.confined import ConfinedProcess, printable
from acquisition.recordings.imports.job import ImportJob
from acquisition.recordings.messages import (
    FAILED,
    READY,
    Frames,
    Message,
    blocks_in,
    frames_of,
    receive,
)
from core.samples.blocks import SampleBlock

SILENCE_S = 300.0
"""Timeout for a message of the child, in seconds; after it the child is considered hung."""

_SIGNALS_OF_FAULTS = {
    signal.SIGABRT,
    signal.SIGBUS,
    signal.SIGFPE,
    signal.SIGILL,
    signal.SIGSEGV,
    signal.SIGXCPU,
}
"""Signals that a malformed file can cause; other signals come from the system or an operator."""

_MAX_IDLE = 2
_idle: deque[ConfinedProcess] = deque()
"""Idle child processes for later requests: a start takes 0.2 s, a request some milliseconds."""


def confined_messages(
    path: Path, format_: str, kind: str, request: Mapping[str, Any]
) -> Generator[Message]:
    """Read a file or recording in the child and yield its messages, until the generator is closed.

    Parameters
    ----------
    format_
        Format of the file: "recording", or the format of an import job.
    kind
        Expected kind of the messages, "blocks" or "frames".
    request
        Other fields of the request.

    Raises
    ------
    ConfigError
        If the file is rejected; the message is one sentence with the path of the file.
    """
    try:
        process = _idle_or_new()
    except OSError as error:
        raise ConfigError(f"{path}: reading process cannot be started: {error.strerror}") from error
    has_ended, refusal = False, None
    try:
        question = {"path": str(path.absolute()), "format": format_} | dict(request)
        process.input.write(json.dumps(question).encode() + b"\n")
        process.input.flush()
        while not has_ended:
            message = receive(process.output)
            found = message[0].get("kind")
            if found == "error":
                refusal = _refusal(message[0])
            elif found == kind:
                yield message
            elif found != "end":
                raise ConfigError(f"{path}: unexpected message from the reading process")
            has_ended = found == "end"
        if refusal is not None:
            raise refusal
    except (EOFError, OSError) as error:
        reason, cause = _why_broken(process, error)
        raise ConfigError(f"{path}: cannot be read as {format_}: {reason}") from cause or EOFError()
    finally:
        if has_ended and len(_idle) < _MAX_IDLE:
            _idle.append(process)
        else:
            process.close()


def _why_broken(process: ConfinedProcess, error: Exception) -> tuple[str, OSError | None]:
    """Return the reason why the child failed, and a system error if the file is not the cause."""
    if isinstance(error, TimeoutError):
        words = f"the reading process sent nothing for {SILENCE_S:g} s"
        return words, _system_error(errno.ETIMEDOUT)
    words, code = process.last_words(), process.exit_code()
    is_of_file = code == FAILED or -code in _SIGNALS_OF_FAULTS
    return words, None if is_of_file else _system_error(errno.EINTR)


def _refusal(head: Mapping[str, Any]) -> ConfigError:
    words, number = str(head.get("message")), head.get("errno")
    error = ConfigError(printable(" ".join(words.split()), 1000))
    error.__cause__ = _system_error(number) if isinstance(number, int) else None
    return error


def _system_error(number: int) -> OSError:
    return OSError(number, os.strerror(number))


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
    module, words = "acquisition.recordings.child", f"no start within {SILENCE_S:g} s"
    process = ConfinedProcess(module, silence_s=SILENCE_S)
    with suppress(TimeoutError):
        if process.output.read(len(READY)):
            return process
        words = process.last_words()
    process.close()
    raise OSError(errno.ENOEXEC, words)


def close_idle_children() -> None:
    """Terminate the idle child processes."""
    while _idle:
        _idle.pop().close()


atexit.register(close_idle_children)


def imported_blocks(path: Path, job: ImportJob) -> Generator[tuple[SampleBlock, float]]:
    """Yield all blocks of a waveform file, each with the fraction of the file read so far.

    The calibration of the blocks is :attr:`ImportJob.calibration`.

    Raises ConfigError if the file does not exist or does not match the job; the message contains
    its path.
    """
    calibration = job.calibration
    for message in _imported(path, job, "blocks"):
        yield from ((block, _done(message)) for block in blocks_in(message, calibration))


def imported_frames(path: Path, job: ImportJob) -> Generator[tuple[Frames, float]]:
    """Yield the frames of a CAN log in batches, each with the fraction of the log read so far.

    Raises ConfigError if the log does not exist or is invalid; the message contains its path.
    """
    for message in _imported(path, job, "frames"):
        yield frames_of(message), _done(message)


def _imported(path: Path, job: ImportJob, kind: str) -> Iterator[Message]:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ConfigError(f"{path}: not a regular file")
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from error
    yield from confined_messages(path, job.format, kind, {"job": asdict(job)})


def _done(message: Message) -> float:
    done = message[0].get("done")
    return min(max(done, 0.0), 1.0) if isinstance(done, float) else 0.0
