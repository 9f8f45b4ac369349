"""A program that appends transactions, and goes on when the disk fails.

``python -m harness.enduring DEEDS FOLDER`` appends the transactions that are pickled in the
file DEEDS to a store in FOLDER. One that fails is tried again, as the service does. The numbers of
those that are durable go into the file ``acks``, what failed into ``errors``. The exit code is 0 if
all are durable, 3 if it gave up. With ``-`` as FOLDER there is one process for each folder on the
standard input, which stops until it is continued; the program says its number, and when it has
ended ``END`` and its exit code.
"""

import os
import pickle
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TypeVar

from harness.deeds import AuditAction, letters
from service.store.port import StoreError
from service.store.sqlite import SqliteStore

ATTEMPTS = 4
GAVE_UP = 3
DATABASE = "padwatch.sqlite3"
T = TypeVar("T")


def main() -> None:
    """Append them, here or in one process after the other."""
    with Path(sys.argv[1]).open("rb") as file:
        deeds: list[AuditAction] = pickle.load(file)  # noqa: S301  our own
    folder = sys.argv[2]
    if folder != "-":
        sys.exit(_endure(Path(folder), deeds))
    for line in sys.stdin:
        sys.stdout.flush()
        pid = os.fork()
        if pid == 0:
            os.kill(os.getpid(), signal.SIGSTOP)
            os._exit(_endure(Path(line.strip()), deeds))
        print(pid, flush=True)
        _, status = os.waitpid(pid, 0)
        print("END", os.waitstatus_to_exitcode(status), flush=True)


def _endure(folder: Path, deeds: Sequence[AuditAction]) -> int:
    acks = os.open(folder / "acks", os.O_WRONLY | os.O_CREAT)
    errors = os.open(folder / "errors", os.O_WRONLY | os.O_CREAT)
    path = folder / "data" / DATABASE
    store = _tried(lambda: SqliteStore(path, address=letters), errors)
    if store is None:
        return GAVE_UP
    for number, deed in enumerate(deeds):
        if not _tried(partial(_append, store, deed), errors):
            return GAVE_UP
        os.write(acks, f"{number}\n".encode())
    with suppress(StoreError):
        store.close()
    return 0


def _tried(do: Callable[[], T], errors: int) -> T | None:
    """Do something, if need be again and again; None if it never succeeds."""
    for _ in range(ATTEMPTS):
        try:
            return do()
        except StoreError as error:
            os.write(errors, f"{error}\n".encode())
    return None


def _append(store: SqliteStore, deed: AuditAction) -> bool:
    deed.append_to(store)
    return True


if __name__ == "__main__":
    main()
