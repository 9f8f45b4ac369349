"""`Allowance`: how often something may be done, a token bucket."""


class Allowance:
    """So many at once, and then one more after each pause.

    Parameters
    ----------
    n_at_once
        How many, however fast they come.
    seconds_each
        Pause after which there may be one more.
    now_s
        Steady time, s.
    """

    def __init__(self, n_at_once: int, seconds_each: float, now_s: float) -> None:
        self._n_at_once, self._seconds_each = float(n_at_once), seconds_each
        self._n_free, self._seen_s = self._n_at_once, now_s

    def take(self, now_s: float) -> bool:
        """Take one if there is one."""
        self._n_free += (now_s - self._seen_s) / self._seconds_each
        self._n_free, self._seen_s = min(self._n_free, self._n_at_once), now_s
        if self._n_free < 1.0:
            return False
        self._n_free -= 1.0
        return True
