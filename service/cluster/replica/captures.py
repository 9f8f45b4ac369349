"""`NoCaptures`: samples around alarms stay in the process that analyses them."""


class NoCaptures:
    """Nothing is captured here."""

    error: str | None = None
    trouble: str | None = None
    n_running = 0
    n_written = 0
    being_made: frozenset[tuple[str, int]] = frozenset()
