"""Child processes that read untrusted files, with limits on memory, CPU time and file size."""

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
"""Maximum size of a file that a child may write: enough for its log, but not to unpack archives."""

_LOG_BYTES_SHOWN = 4000

_ENVIRONMENT = {
    "ARROW_DEFAULT_MEMORY_POOL": "system",  # other pools reserve address space, which is limited
    "HDF5_PLUGIN_PRELOAD": "::",  # disables filter plugins named in a file
    "OPENBLAS_NUM_THREADS": "1",  # each thread reserves address space
}


class ConfinedProcess:
    """Child process ``python -m module arguments``; call `close` after use.

    Parameters
    ----------
    silence_s
        Timeout in seconds of a read from ``output``; the read then raises TimeoutError. None for no
        timeout.

    Attributes
    ----------
    input
        Stream to the standard input of the child.
    output
        Stream from the standard output of the child.

    Raises
    ------
    OSError
        If the system cannot start the process.
    """

    def __init__(self, module: str, *arguments: str, silence_s: float | None = None) -> None:
        search = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        self._log = tempfile.TemporaryFile()  # noqa: SIM115  closed with the process
        ours, theirs = socket.socketpair()  # unlike pipes, with a time-out
        with ours, theirs:
            self._process = subprocess.Popen(  # noqa: S603  our own module
                [sys.executable, "-P", "-m", module, *arguments],
                stdin=theirs.fileno(),
                stdout=theirs.fileno(),
                stderr=self._log,
                env=os.environ | _ENVIRONMENT | search,
                process_group=0,
            )
            ours.settimeout(silence_s)
            self.input, self.output = ours.makefile("wb"), ours.makefile("rb")

    def exit_code(self) -> int:
        """Wait for the end of the child; return its exit code, or -N after an end by signal N."""
        return self._process.wait()

    def is_running(self) -> bool:
        """Return whether the child is still running."""
        return self._process.poll() is None

    def clear_log(self) -> None:
        """Delete the captured standard error output of the child."""
        self._log.seek(0)
        self._log.truncate()

    def last_words(self) -> str:
        """Wait for the end of the child; return its last log line, or the signal that ended it."""
        code = self._process.wait()
        if code < 0:
            return f"the reading process was ended by {signal.Signals(-code).name}"
        size = self._log.seek(0, os.SEEK_END)
        self._log.seek(max(0, size - _LOG_BYTES_SHOWN))
        text = self._log.read(_LOG_BYTES_SHOWN).decode("utf-8", "replace")
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        return printable(lines[-1] if lines else f"the reading process ended with exit code {code}")

    def close(self) -> None:
        """Kill the child and its process group, and close its streams."""
        if self.is_running():
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for stream in (self.input, self.output, self._log):
            with suppress(OSError):  # unsent requests to a child that has ended
                stream.close()


def confine(memory_bytes: int) -> None:
    """Limit this process to an address space of `memory_bytes`; limit CPU time and file sizes."""
    for kind, limit in (
        (resource.RLIMIT_AS, memory_bytes),
        (resource.RLIMIT_CPU, CPU_S),
        (resource.RLIMIT_CORE, 0),
        (resource.RLIMIT_FSIZE, LOG_BYTES),
    ):
        _, highest = resource.getrlimit(kind)  # cannot be raised without privileges
        limit = limit if highest == resource.RLIM_INFINITY else min(limit, highest)
        is_lower = kind == resource.RLIMIT_CPU and limit != highest
        resource.setrlimit(kind, (limit, limit + is_lower))  # SIGXCPU precedes SIGKILL


def memory_in_use_bytes() -> int:
    """Return the address space of this process in bytes; `confine` limits it."""
    n_pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    return n_pages * resource.getpagesize()


def printable(text: str, max_length: int = 300) -> str:
    """Return a text that is safe to print: cut to `max_length`, control characters replaced."""
    return "".join(c if c.isprintable() else "�" for c in text)[:max_length]
