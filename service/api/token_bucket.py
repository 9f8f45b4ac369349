"""Token bucket for the rate limits of comments and of audit entries."""


class TokenBucket:
    """Token bucket for a rate limit.

    Parameters
    ----------
    n_at_once
        Capacity of the bucket, tokens; the bucket is full at the start.
    seconds_each
        Time after which a token is added, s.
    now_s
        Monotonic time of the start, s.
    """

    def __init__(self, n_at_once: int, seconds_each: float, now_s: float) -> None:
        self._n_at_once, self._seconds_each = float(n_at_once), seconds_each
        self._n_free, self._seen_s = self._n_at_once, now_s

    def take(self, now_s: float) -> bool:
        """Take a token if one is available at the monotonic time `now_s`; return whether it was."""
        self._n_free += (now_s - self._seen_s) / self._seconds_each
        self._n_free, self._seen_s = min(self._n_free, self._n_at_once), now_s
        if self._n_free < 1.0:
            return False
        self._n_free -= 1.0
        return True
