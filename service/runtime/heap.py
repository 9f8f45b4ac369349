"""How the C library keeps what the program has given up."""

import ctypes

TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
"""Numbers of what can be set, of the GNU C library (malloc.h)."""

LARGE_BYTES = 1 << 20


def return_large_pieces() -> None:
    """Have large arrays always come from the machine, and go back to it when they are done with.

    By itself the GNU C library raises the size from which it does so to that of what was given
    back, to 32 MiB at most (mallopt(3)). From then on arrays that come and go with each result lie
    between pieces that stay, and leave holes there: the process keeps more than it uses. Another C
    library is left as it is.
    """
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        for threshold in (MMAP_THRESHOLD, TRIM_THRESHOLD):
            mallopt(threshold, LARGE_BYTES)
