"""Ctrl-C on a terminal, when padwatch runs below make."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def terminal_to_itself() -> Iterator[None]:
    """Take the terminal's foreground, so that Ctrl-C reaches this process alone.

    Below ``make``, Ctrl-C would also reach make, which then reports an orderly end as an error.
    Without a terminal, or when the process already leads its group, nothing happens.
    """
    group = os.getpgrp()
    if not sys.stdin.isatty() or group == os.getpid() or os.tcgetpgrp(0) != group:
        yield
        return
    before = signal.signal(signal.SIGTTOU, signal.SIG_IGN)  # or giving it back would stop us
    os.setpgid(0, 0)
    os.tcsetpgrp(0, os.getpgrp())
    try:
        yield
    finally:
        os.tcsetpgrp(0, group)
        signal.signal(signal.SIGTTOU, before)
