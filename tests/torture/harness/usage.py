"""What a process takes of the machine, as time goes by; and whether that grows."""

import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from core.arrays import FloatArray

MIB = 2**20
BATCH_S = 20.0
"""Readings closer together than this are alike, and count as one."""

MOST_ALIKE = 0.95

T_95 = 2.1
"""Student's t for 95 % and about eighteen degrees of freedom."""


@dataclass(frozen=True)
class Usage:
    """One look at a process and its write-ahead log."""

    at_s: float
    rss_mib: float
    n_files: int
    n_threads: int
    log_mib: float
    cpu_s: float


def look(process: psutil.Process, log: Path) -> Usage:
    """Look once."""
    with process.oneshot():
        cpu = process.cpu_times()
        return Usage(
            at_s=time.monotonic(),
            rss_mib=process.memory_info().rss / MIB,
            n_files=process.num_fds(),
            n_threads=process.num_threads(),
            log_mib=log.stat().st_size / MIB if log.exists() else 0.0,
            cpu_s=cpu.user + cpu.system,
        )


@dataclass(frozen=True)
class Slope:
    """Growth of something, with the half width of its 95 % interval, per hour."""

    per_hour: float
    half_width: float

    def __str__(self) -> str:
        return f"{self.per_hour:+.1f} ± {self.half_width:.1f}"


def slope(at_s: FloatArray, value: FloatArray) -> Slope:
    """Fit a straight line through means of batches (least squares).

    Memory comes in steps, so neighbouring residuals are alike: the interval is that of as many
    independent ones as their correlation leaves (autoregressive, of first order).
    """
    batch = ((at_s - at_s[0]) // BATCH_S).astype(int)
    t = np.array([at_s[batch == b].mean() for b in np.unique(batch)]) / 3600.0
    y = np.array([value[batch == b].mean() for b in np.unique(batch)])
    if len(t) < 3:
        return Slope(0.0, math.inf)
    dt = t - t.mean()
    gain = float(dt @ y / (dt @ dt))
    residual = y - y.mean() - gain * dt
    alike = float(residual[1:] @ residual[:-1]) / (float(residual @ residual) or 1.0)
    alike = min(max(alike, 0.0), MOST_ALIKE)
    error = math.sqrt(float(residual @ residual) / (len(t) - 2) / float(dt @ dt))
    error *= math.sqrt((1.0 + alike) / (1.0 - alike))
    return Slope(gain, T_95 * error)
