"""A program that appends transactions and says of each one when it is durable.

``python -m harness.writing DATABASE FILE [BUG]`` with the transactions pickled in a file, and
perhaps a bug to do it with.
"""

import os
import pickle
import sys
from pathlib import Path

from harness.deeds import letters
from service.store.sqlite import SqliteStore


def main() -> None:
    """Append them all."""
    with Path(sys.argv[2]).open("rb") as file:
        deeds = pickle.load(file)  # noqa: S301  our own
    bug = sys.argv[3] if len(sys.argv) > 3 else ""
    store = SqliteStore(Path(sys.argv[1]), address=letters)
    if bug == "synchronous_normal":
        store._writer.execute("PRAGMA synchronous = NORMAL")
    for number, done in enumerate(deeds):
        if bug == "acknowledged_before_commit":
            os.write(1, f"ACK {number}\n".encode())
            done.append_to(store)
        elif bug == "two_transactions":
            store.append([done.assessment], [done.gap])
            store.append([], [], [done.alarm])
            os.write(1, f"ACK {number}\n".encode())
        else:
            done.append_to(store)
            os.write(1, f"ACK {number}\n".encode())
    store.close()


if __name__ == "__main__":
    main()
