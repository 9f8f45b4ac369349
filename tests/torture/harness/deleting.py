"""A program that deletes what is old until nothing is: ``python -m harness.deleting DATABASE``."""

import sys
from contextlib import closing
from pathlib import Path

from service.store.retention.limits import RetentionLimits
from service.store.sqlite import SqliteStore

EVERYTHING = RetentionLimits(readings_ns=0, minutes_ns=0)
LATER_NS = 1 << 62


def main() -> None:
    """Delete it."""
    with closing(SqliteStore(Path(sys.argv[1]))) as store:
        print("begun", flush=True)
        for series in store.retention.series():
            while store.retention.delete(series, EVERYTHING, LATER_NS):
                pass
    print("done", flush=True)


if __name__ == "__main__":
    main()
