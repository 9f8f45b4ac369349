"""Child processes that read foreign files, with limits on memory, processor time and files."""

import os
import resource
import signal
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

CPU_S = 3600
LOG_BYTES = 1_000_000
"""Largest file that a child may write: enough for its log, too small for an unpacked archive."""

_LOG_BYTES_SHOWN = 4000

_ENVIRONMENT = {
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # others reserve address space, which is limited
    "HDF5_PLUGIN_PRELOAD": "::",  # no filters from libraries that a file names
    "OPENBLAS_NUM_THREADS": "1",  # each thread takes address space
}


class ConfinedProcess:
    """Child process ``python -m module arguments``; to be closed.

    Parameters
    ----------
    silence_s
        How long a read from ``output`` waits before it raises TimeoutError; None: for ever.

    Attributes
    ----------
    input, output
        Standard input and output of the child.

    Raises
    ------
    OSError
        If the system cannot start another process now.
    """

    def __init__(self, module: str, *arguments: str, silence_s: float | None = None) -> None:
        search = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        self._log = tempfile.TemporaryFile()  # noqa: SIM115  closed with the process
        ours, theirs = socket.socketpair()  # unlike pipes, with a time-out
        with ours, theirs:
            self._process = subprocess.Popen(  # noqa: S603  our own module
                [sys.executable, "-m", module, *arguments],
                stdin=theirs.fileno(),
                stdout=theirs.fileno(),
                stderr=self._log,
                env=os.environ | _ENVIRONMENT | search,
                process_group=0,
            )
            ours.settimeout(silence_s)
            self.input, self.output = ours.makefile("wb"), ours.makefile("rb")

    def exit_code(self) -> int:
        """Wait for the end of the child; negative if a signal ended it."""
        return self._process.wait()

    def is_running(self) -> bool:
        """Whether the child has not ended yet."""
        return self._process.poll() is None

    def clear_log(self) -> None:
        """Forget what the child has written to standard error so far."""
        self._log.seek(0)
        self._log.truncate()

    def last_words(self) -> str:
        """Wait for the end of the child; its last line of log, or the signal that ended it."""
        code = self._process.wait()
        if code < 0:
            return f"reading it was ended by {signal.Signals(-code).name}"
        size = self._log.seek(0, os.SEEK_END)
        self._log.seek(max(0, size - _LOG_BYTES_SHOWN))
        text = self._log.read(_LOG_BYTES_SHOWN).decode("utf-8", "replace")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        return printable(lines[-1] if lines else f"reading it ended with code {code}")

    def close(self) -> None:
        """End the child and what it has started."""
        if self.is_running():
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for stream in (self.input, self.output, self._log):
            with suppress(OSError):  # the child no longer takes requests
                stream.close()


def confine(memory_bytes: int) -> None:
    """Limit memory, processor time and files that this process may use from now on."""
    for kind, limit in (
        (resource.RLIMIT_AS, memory_bytes),
        (resource.RLIMIT_CPU, CPU_S),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_FSIZE, LOG_BYTES),
    ):
        highest = resource.getrlimit(kind)[1]  # inherited; an unprivileged process cannot raise it
        limit = limit if highest == resource.RLIM_INFINITY else min(limit, highest)
        is_lower = kind == resource.RLIMIT_CPU and limit != highest
        resource.setrlimit(kind, (limit, limit + is_lower))  # SIGXCPU comes before SIGKILL


def memory_in_use_bytes() -> int:
    """Address space of this process, which is what `confine` limits."""
    n_pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    return n_pages * resource.getpagesize()


def printable(text: str, max_length: int = 300) -> str:
    """Text without control characters, safe to print on a terminal."""
    return "".join(c if c.isprintable() else "�" for c in text)[:max_length]
