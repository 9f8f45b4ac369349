"""A long time under load: what it takes of the machine, and whether every account closes."""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from core.arrays import FloatArray
from harness.bench import Bench
from harness.checker import Findings
from harness.ledger_plant import LedgerPlant
from service.app.storage import DATABASE

LOOK_S = 2.0
WARM_UP = 0.4
"""Share of the time after which memory must not grow any more: windows are full by then."""


MIB = 2**20
BATCH_S = 20.0
"""Readings closer together than this are alike, and count as one."""

MOST_ALIKE = 0.95

T_95 = 2.1
"""Student's t for 95 % and about eighteen degrees of freedom."""


@dataclass(frozen=True)
class Usage:
    """One look at the measuring and the serving process, together, and the write-ahead log."""

    at_s: float
    memory_mib: float
    """Pages of their own, and once those that they share (libraries)."""
    n_files: int
    n_threads: int
    log_mib: float
    cpu_s: float
    waited_s: float
    """Time for which measuring's event loop was ready to run and waited for a processor."""


def look(processes: Sequence[psutil.Process], log: Path) -> Usage:
    """Look once at measuring and serving, in this order."""
    waited = Path(f"/proc/{processes[0].pid}/schedstat").read_text().split()[1]
    memories = [process.memory_full_info() for process in processes]
    shared = max(memory.rss - memory.uss for memory in memories)
    return Usage(
        at_s=time.monotonic(),
        memory_mib=(shared + sum(memory.uss for memory in memories)) / MIB,
        n_files=sum(process.num_fds() for process in processes),
        n_threads=sum(process.num_threads() for process in processes),
        log_mib=log.stat().st_size / MIB if log.exists() else 0.0,
        cpu_s=sum(sum(process.cpu_times()[:2]) for process in processes),
        waited_s=int(waited) / 1e9,
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


@dataclass(frozen=True)
class Soaked:
    """What was measured.

    Parameters
    ----------
    open_accounts
        Units whose service counts other samples than it was offered, in words.
    """

    seconds: float
    ready_s: float
    usages: Sequence[Usage]
    daq_cores: float
    findings: Findings
    open_accounts: Sequence[str]
    n_offered: int
    n_gap: int
    silent_healthy_s: float

    @property
    def settled(self) -> Sequence[Usage]:
        """The looks after the warm-up."""
        return self.usages[int(WARM_UP * len(self.usages)) :]

    @property
    def cores(self) -> float:
        """Share of a core that measuring and serving took together."""
        first, last = self.settled[0], self.settled[-1]
        return (last.cpu_s - first.cpu_s) / max(last.at_s - first.at_s, 1e-9)

    @property
    def waiting_share(self) -> float:
        """Share of the time in which other programs had the processor that the service wanted."""
        first, last = self.usages[0], self.usages[-1]
        return (last.waited_s - first.waited_s) / max(last.at_s - first.at_s, 1e-9)

    def growth(self, name: str) -> Slope:
        """How something grew after the warm-up."""
        return slope(self._values("at_s"), self._values(name))

    def rise(self, name: str) -> float:
        """How much more of something there was at most in the second half after the warm-up."""
        values = self._values(name)
        half = len(values) // 2
        return float(values[half:].max() - values[:half].max())

    def most(self, name: str) -> float:
        """The most of something after the warm-up."""
        return float(self._values(name).max())

    def _values(self, name: str) -> FloatArray:
        return np.array([float(getattr(usage, name)) for usage in self.settled])

    def table(self, plant: LedgerPlant) -> str:
        """One line for each figure."""
        per_sample_us = 1e6 * self.cores / (plant.n_units * 12 * plant.rate_hz)
        figures = {
            "minutes": round(self.seconds / 60.0, 1),
            "units, times nominal": f"{plant.n_units}, {plant.load:g}",
            "service, cores": f"{self.cores:.2f} ({per_sample_us:.2f} µs a sample)",
            "waited for a processor": f"{100.0 * self.waiting_share:.0f} % of the time",
            "ledger DAQ, cores": f"{self.daq_cores:.2f}",
            "memory, MiB": f"{self.most('memory_mib'):.0f}, {self.growth('memory_mib')} an hour",
            "open files": f"{self.most('n_files'):.0f}, {self.growth('n_files')} an hour",
            "threads": f"{self.most('n_threads'):.0f}, {self.growth('n_threads')} an hour",
            "write-ahead log, MiB": f"{self.most('log_mib'):.1f} at most",
            "samples offered, per channel": self.n_offered,
            "of these in gaps": self.n_gap,
            "accounts that do not close": len(self.open_accounts),
            "silent-healthy seconds": round(self.silent_healthy_s, 3),
            **{f"checked units: {name}": n for name, n in self.findings.counts.items()},
        }
        return "\n".join(f"  {name:<32}{value}" for name, value in figures.items())


def soak(bench: Bench, seconds: float, checked: Sequence[str]) -> Soaked:
    """Run a service for so long, and compare some of its units bit for bit.

    Parameters
    ----------
    checked
        Units whose every stored number is computed again; the accounts of all are looked at.
    """
    ready_s = bench.begin()
    bench.watch.wait_for_result()
    log = bench.plant_file.parent / "data" / f"{DATABASE}-wal"
    service, device = bench.rig.processes(), psutil.Process(bench.daq.process.pid)
    begun_s, device_s = time.monotonic(), sum(device.cpu_times()[:2])
    usages = [look(service, log)]
    while usages[-1].at_s - begun_s < seconds:
        time.sleep(min(LOOK_S, seconds / 10.0))
        usages.append(look(service, log))
    passed_s = time.monotonic() - begun_s
    device_s = sum(device.cpu_times()[:2]) - device_s
    sources = {unit["id"]: unit["source"] for unit in bench.get("units")}
    return Soaked(
        seconds=passed_s,
        ready_s=ready_s,
        usages=usages,
        daq_cores=device_s / passed_s,
        findings=bench.end(checked),
        open_accounts=[unit for unit in bench.plant.units if not _closes(sources[unit])],
        n_offered=sum(int(source["n_offered"]) for source in sources.values()),
        n_gap=sum(int(source["n_gap"]) for source in sources.values()),
        silent_healthy_s=bench.silent_healthy_s(),
    )


def _closes(source: dict[str, int | dict[str, int]]) -> bool:
    """Whether offered = stored + flagged + gap + rejected."""
    taken = sum(int(source[name]) for name in ("n_stored", "n_flagged", "n_gap"))  # type: ignore[call-overload]
    rejected = source["rejected"]
    assert isinstance(rejected, dict)
    return taken + sum(rejected.values()) == source["n_offered"]
