"""What a wrong reply means for a connection."""

from collections.abc import Iterator
from contextlib import contextmanager

from acquisition.errors import FrameError, LinkError


@contextmanager
def wrong_replies_drop_the_link() -> Iterator[None]:
    """Turn a wrong reply into a lost link: nothing that comes after it can be trusted."""
    try:
        yield
    except FrameError as exc:
        raise LinkError(f"wrong reply, connection dropped: {exc}") from exc
