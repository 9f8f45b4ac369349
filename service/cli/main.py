"""Entry point of the `padwatch` command."""

import gc
import os
import tempfile
import traceback
from typing import NoReturn

import typer

from service.cli import commands
from service.runtime.process import leave

EXIT_BUG = 70
EXIT_INTERRUPTED = 130

PRIVATE = 0o077
"""umask: only the owner reads files; the database holds password hashes."""


def main() -> NoReturn:
    """Run the command line and end the process with its exit code.

    An internal error is printed as one line, and its traceback is written to a temporary file.
    """
    os.umask(PRIVATE)
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # matrices are small: threads only spin
    code = _exit_code()
    if code == EXIT_INTERRUPTED:
        gc.collect()  # frees the semaphores of a pool of processes, which `leave` would leak
    leave(code)


def _exit_code() -> int:
    try:
        commands.app()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except Exception:  # last resort: a sentence for users, the traceback in the report
        with tempfile.NamedTemporaryFile(
            "w", prefix="padwatch-", suffix=".txt", delete=False
        ) as report:
            traceback.print_exc(file=report)
        typer.echo(f"padwatch: stopped by an internal error; the report is {report.name}", err=True)
        return EXIT_BUG
    return 0


if __name__ == "__main__":
    main()
