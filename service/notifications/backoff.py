"""How long to wait after attempts in vain."""

import random
from collections.abc import Callable

FIRST_S = 1.0


def wait_s(
    n_failures: int,
    retry_after_s: float | None,
    longest_s: float,
    share: Callable[[], float] = random.random,
) -> float:
    """Twice as long after each failure, up to a limit, less up to half of it by chance.

    Receivers that failed together are so not tried together.

    Parameters
    ----------
    n_failures
        In a row, 1 or more.
    retry_after_s
        What the receiver has asked for: waited for in full, up to the limit.
    share
        Chance, 0 to 1.
    """
    doubled_s = FIRST_S * 2.0 ** min(n_failures - 1, 30)
    drawn_s = min(doubled_s, longest_s) * (1.0 - 0.5 * share())
    return max(drawn_s, min(retry_after_s or 0.0, longest_s))
