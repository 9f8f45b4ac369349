"""`Freshness`: a device that answers, but whose data stand still, is not connected."""

from acquisition.errors import LinkError


class Freshness:
    """Watches something that must change from time to time.

    Parameters
    ----------
    what
        In words; example: "the heartbeat".
    stale_after_s
        Longest time without a change.
    """

    def __init__(self, what: str, stale_after_s: float) -> None:
        self._what, self._stale_after_s = what, stale_after_s
        self._seen: bytes | None = None
        self._since_s = 0.0
        self._stood_still = False

    def opened(self, now_s: float) -> None:
        """Note a new connection: only one that was lost for standing still begins suspected."""
        if not self._stood_still:
            self._since_s = now_s

    def note(self, alive: bytes, now_s: float) -> None:
        """Note what was found.

        Raises
        ------
        LinkError
            If it has not changed for too long.
        """
        if alive != self._seen:
            self._seen, self._since_s, self._stood_still = alive, now_s, False
            return
        standing_s = now_s - self._since_s
        if standing_s > self._stale_after_s:
            self._stood_still = True
            raise LinkError(
                f"the device answers but its data stand still: {self._what} has not changed for"
                f" {standing_s:.1f} s"
            )
