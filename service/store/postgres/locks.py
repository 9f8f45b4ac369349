"""Numbers of advisory locks: names of a database that one session at a time may hold."""

import hashlib


def lock_number(name: str) -> int:
    """The number that stands for a name, the same in every padwatch."""
    digest = hashlib.sha256(b"padwatch " + name.encode("utf-8", "surrogateescape")).digest()
    return int.from_bytes(digest[:8], "big", signed=True)


MIGRATING = lock_number("/migrating")
WRITING = lock_number("/writing")
"""Held by every transaction that writes: as in SQLite, one writes at a time."""
