"""How far the results of a unit reach on a stream of blocks."""

from dataclasses import dataclass


@dataclass(frozen=True)
class StreamPosition:
    """Up to which message of a stream the stored results of a unit reach.

    Parameters
    ----------
    stream
        Which stream; another one where it was made anew, whose messages are counted anew.
    sequence
        Newest message whose results are stored.
    window_sequence
        First message that must be looked at once more to go on from there.
    memory
        Document: what must be known beside these messages.
    """

    unit: str
    stream: str
    sequence: int
    window_sequence: int
    memory: bytes
