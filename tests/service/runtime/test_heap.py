"""Large arrays that are done with go back to the machine, wherever they lay."""

import subprocess
import sys

HOLES = """
import numpy as np, psutil
from service.runtime.process import return_large_pieces

return_large_pieces()
del [np.ones(2 << 20)][0]  # 16 MiB come and go: by itself the C library thinks this usual now
large, stays = [], []
for _ in range(64):
    large.append(np.ones(256 << 10))  # 2 MiB
    stays.append(np.ones(8 << 10))
process = psutil.Process()
before = process.memory_info().rss
del large
print((before - process.memory_info().rss) >> 20)
"""


def test_arrays_of_a_result_leave_no_holes_between_what_stays():
    done = subprocess.run([sys.executable, "-c", HOLES], capture_output=True, text=True, check=True)
    assert 120 <= int(done.stdout) <= 130
