"""Entry point of the `padwatch` command."""

import gc
import os
import tempfile
import traceback
from typing import NoReturn

import typer

from service.runtime.process import leave

EXIT_BUG = 70

PRIVATE = 0o077
"""Files are for their user alone: the database holds password hashes, recordings the plant."""


def main() -> NoReturn:
    """Run the command line; a bug ends it with one line and a report for its makers."""
    os.umask(PRIVATE)
    leave(_exit_code())


def _commands() -> typer.Typer:
    """Load the program; what is loaded stays, and is not looked through for what may go."""
    gc.disable()  # it would be, a hundred times: a fifth of the time that loading takes
    from service.cli.commands import app

    gc.freeze()
    gc.enable()
    return app


def _exit_code() -> int:
    try:
        _commands()()
    except SystemExit as ended:
        return ended.code if isinstance(ended.code, int) else int(ended.code is not None)
    except Exception:  # the outermost rim: users get a sentence, the report gets the traceback
        with tempfile.NamedTemporaryFile(
            "w", prefix="padwatch-", suffix=".txt", delete=False
        ) as report:
            traceback.print_exc(file=report)
        typer.echo(f"padwatch: stopped by an internal error; the report is {report.name}", err=True)
        return EXIT_BUG
    return 0


if __name__ == "__main__":
    main()
