"""A process of its own for reading a foreign file, which may fail there in any way it likes."""

import os
import resource
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO

_LAST_BYTES = 4000


class ReadingProcess:
    """The reading process as its parent sees it; see :func:`reading_process`."""

    def __init__(self, process: "subprocess.Popen[bytes]", log: IO[bytes]) -> None:
        self._process, self._log = process, log

    @property
    def job(self) -> IO[bytes]:
        """Where it is told what to do."""
        return _piped(self._process.stdin)

    @property
    def found(self) -> IO[bytes]:
        """What it finds."""
        return _piped(self._process.stdout)

    def exit_code(self) -> int:
        """Wait for its end; negative, if a signal ended it."""
        return self._process.wait()

    def last_words(self) -> str:
        """Wait for its end; what it said last, or what ended it, in one printable line."""
        code = self._process.wait()
        if code < 0:
            return f"reading it was ended by {signal.Signals(-code).name}"
        size = self._log.seek(0, os.SEEK_END)
        self._log.seek(max(0, size - _LAST_BYTES))
        text = self._log.read(_LAST_BYTES).decode("utf-8", "replace")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        return printable(lines[-1] if lines else f"reading it ended with code {code}")


@contextmanager
def reading_process(
    module: str, path: Path, environment: Mapping[str, str]
) -> Iterator[ReadingProcess]:
    """Start ``python -m module path``; leaving the context ends it.

    Parameters
    ----------
    environment
        Beside what this process has.
    """
    search = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(  # noqa: S603  our own module
            [sys.executable, "-m", module, str(path.absolute())],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            env=os.environ | dict(environment) | search,
        )
        try:
            yield ReadingProcess(process, log)
        finally:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                _piped(pipe).close()


def confine(memory_bytes: int, cpu_s: int, log_bytes: int) -> None:
    """Limit what this process, the reading one, may use.

    Parameters
    ----------
    log_bytes
        Most that it may write to a file: its own last words, and no unpacked archives.
    """
    for kind, limit in (
        (resource.RLIMIT_AS, memory_bytes),
        (resource.RLIMIT_CPU, cpu_s),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_FSIZE, log_bytes),
    ):
        most = resource.getrlimit(kind)[1]  # of whoever started us, and never to be raised
        limit = limit if most == resource.RLIM_INFINITY else min(limit, most)
        resource.setrlimit(kind, (limit, limit))


def printable(text: str) -> str:
    """A line as a terminal may have it: what a file says may be anything."""
    return "".join(c if c.isprintable() else "�" for c in text)[:300]


def _piped(pipe: IO[bytes] | None) -> IO[bytes]:
    if pipe is None:
        raise ValueError("the process was started without this pipe")
    return pipe
