"""Whether what is seen happens now or is played from a recording."""

from enum import StrEnum


class Origin(StrEnum):
    """Where samples come from; a replay never shares a database with the live plant."""

    LIVE = "live"
    REPLAY = "replay"
