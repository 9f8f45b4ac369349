"""Memory in which nothing is goes back to the machine while the program runs."""

import subprocess
import sys

FILL_AND_FREE = """
import numpy as np, psutil
from service.spare_memory import give_back
process = psutil.Process()
held = [np.ones(1024) for _ in range(16_384)]  # 128 MiB in pieces of 8 KiB
kept = held[::512]
del held
before = process.memory_info().rss
give_back()
print((before - process.memory_info().rss) >> 20, sum(piece.sum() for piece in kept))
"""


def test_holes_between_what_is_in_use_are_given_back() -> None:
    done = subprocess.run(
        [sys.executable, "-c", FILL_AND_FREE], capture_output=True, text=True, check=True
    )
    given_mib, still_there = done.stdout.split()
    assert int(given_mib) > 100
    assert float(still_there) == 32 * 1024
