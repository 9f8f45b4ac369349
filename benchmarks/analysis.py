"""What the analysis costs: CPU per channel-second beside plain scipy over the whole window.

padwatch transforms each segment once, when its last sample is there. The alternative is what a
script would do each second: over the whole five minutes `scipy.signal.welch` of every channel and
`scipy.signal.csd` of every pair in a bearing's matrix (6 for a bearing). Ends with 1 below 500
times cheaper. Beside it, for comparison, csd of shaft and bearing in one direction alone (2 for a
bearing), which is enough for `ratio` and `transfer` but not for `dynamic`.

Each hop takes another segment of the five minutes, so that `dynamic` finds a film each time: of one
segment repeated it refuses to, and ends early.
"""

import argparse
import itertools
import os
import sys
import time
from collections.abc import Callable

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")

import numpy as np
import scipy.signal

from benchmarks.accuracy_plant import RATE_HZ, machine
from core.arrays import FloatArray
from core.machine.channel import Measurand
from core.machine.unit import BearingAccuracy, BracketDynamics, Unit
from core.monitor.assessment import AnalysisSettings
from core.quality import GOOD, Reading, Reason
from core.samples.ring import Window
from core.spectra.cross_spectrum import (
    BEARING_X,
    BEARING_Y,
    SHAFT_X,
    SHAFT_Y,
    CrossSpectrum,
    average,
    roundness,
)
from core.spectra.segments import ORDER1, VORTEX, SegmentTransform
from core.stiffness.dynamic import DynamicStiffness, FilmSpectrum, films
from core.stiffness.dynamic_lines import DynamicSettings
from core.stiffness.dynamic_readings import dynamic_budgets
from core.stiffness.stiffness_budget import ratio_budget, transfer_budgets
from service.runtime.process import return_large_pieces

REQUIRED_RATIO = 500.0
WINDOW_S = 300
SPEED_RPM = 92.3


def signals(unit: Unit, n_samples: int) -> FloatArray:
    """Noise with as much in common between shaft and bearing that every estimator runs."""
    rng = np.random.default_rng(1)
    low = scipy.signal.butter(2, 20.0, fs=RATE_HZ, output="sos")
    moved = scipy.signal.sosfilt(low, rng.standard_normal((len(unit.channels), n_samples)), axis=1)
    order1 = np.cos(2.0 * np.pi * SPEED_RPM / 60.0 * np.arange(n_samples) / RATE_HZ)
    for bearing in range(len(unit.bearings)):
        rows = slice(4 * bearing, 4 * bearing + 4)
        moved[rows] += order1
        moved[rows][2:] = 0.5 * moved[rows][:2] + 0.01 * moved[rows][2:]
    found: FloatArray = moved
    return found


class Analysis:
    """Segments, cross-spectra and every estimator of one unit, as a monitor runs them."""

    def __init__(self, unit: Unit) -> None:
        self._unit, self._settings = unit, AnalysisSettings()
        self._transform = SegmentTransform(unit, self._settings)

    def add(self, samples: FloatArray, index: int) -> int:
        """Take in the newest segment and evaluate all bearings; count the results of `dynamic`."""
        self._transform.add(
            Window(
                epoch=1,
                first_index=index,
                start_ns=0,
                rate_hz=RATE_HZ,
                samples=samples.astype(np.float32),
                channel_quality=(GOOD,) * len(self._unit.channels),
                slow={"speed": Reading(SPEED_RPM)},
            )
        )
        spectra = [self._bearing(4 * bearing) for bearing in range(len(self._unit.bearings))]
        turn_hz, bracket = SPEED_RPM / 60.0, BracketDynamics(1.18e9, 0.45e5)
        measured = [FilmSpectrum(bins, bracket, (turn_hz, turn_hz)) for bins, _ in spectra]
        found = films(measured, DynamicSettings())
        for film, (_, orders) in zip(found, spectra, strict=True):
            self._budgets(film, orders, bracket)
        return sum(isinstance(film, DynamicStiffness) for film in found)

    def _bearing(self, row: int) -> tuple[CrossSpectrum, CrossSpectrum]:
        segments = list(self._transform.segments)
        rows = slice(row, row + 4)
        usable = np.ones((len(segments), 4), dtype=bool)
        return (
            average(
                self._transform.frequency_hz,
                np.stack([s.bin_phasors_um_pk[rows].T for s in segments], axis=2).transpose(
                    2, 1, 0
                ),
                usable,
            ),
            average(
                segments[-1].order_frequency_hz,
                np.array([s.order_phasors_um_pk[rows] for s in segments]),
                usable,
            ),
        )

    def _budgets(
        self, film: DynamicStiffness | Reason, orders: CrossSpectrum, bracket: BracketDynamics
    ) -> None:
        accuracy = BearingAccuracy()
        if isinstance(film, DynamicStiffness):
            dynamic_budgets(film, bracket, accuracy)
        for line in (ORDER1, VORTEX):
            roundness(orders, line)
            for shaft, bearing in ((SHAFT_X, BEARING_X), (SHAFT_Y, BEARING_Y)):
                ratio_budget(orders, line, shaft, bearing, bracket, accuracy)
                transfer_budgets(orders, line, shaft, bearing, bracket, accuracy)


ALL_PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
DIRECTIONS = ((0, 2), (1, 3))


def welch_and_csd(samples: FloatArray, pairs: tuple[tuple[int, int], ...]) -> None:
    """Do what a script does each second, over the whole window."""
    for channel in samples:
        scipy.signal.welch(channel, RATE_HZ, "hann", nperseg=8192, noverlap=1024)
    for bearing in samples.reshape(-1, 4, samples.shape[1]):
        for i, j in pairs:
            scipy.signal.csd(bearing[i], bearing[j], RATE_HZ, "hann", nperseg=8192, noverlap=1024)


def cpu_s(work: Callable[[], object], repeats: int) -> float:
    """Least CPU time of one of `repeats` runs: what others do on the machine only adds to it."""
    times = []
    for _ in range(repeats):
        start_s = time.process_time()
        work()
        times.append(time.process_time() - start_s)
    return min(times)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hops", type=int, default=100, help="segments that are evaluated")
    arguments = parser.parse_args()
    unit, settings = machine(Measurand.ACCELERATION_M_S2), AnalysisSettings()
    n_channels = len(unit.channels)
    samples = signals(unit, WINDOW_S * int(RATE_HZ))
    whole_us = 1e6 * cpu_s(lambda: welch_and_csd(samples, ALL_PAIRS), 5) / n_channels
    directions_us = 1e6 * cpu_s(lambda: welch_and_csd(samples, DIRECTIONS), 5) / n_channels
    return_large_pieces()  # as the program does, and a script does not
    analysis, hop = Analysis(unit), settings.hop_samples
    starts = range(0, samples.shape[1] - settings.segment_samples, hop)
    segments = [samples[:, start : start + settings.segment_samples] for start in starts]
    hops = zip(itertools.cycle(segments), itertools.count(0, hop), strict=False)
    n_found = [analysis.add(*next(hops)) for _ in segments]
    ours_s = cpu_s(lambda: n_found.append(analysis.add(*next(hops))), arguments.hops)
    if min(n_found[-arguments.hops - 1 :]) < len(unit.bearings):
        print("a bearing had no result of `dynamic`: nothing to compare")
        return 1
    ours_us = 1e6 * ours_s / (n_channels * hop / RATE_HZ)
    print("CPU per channel-second, 12 channels at 600 Hz, Hann 8192, 12.5 % overlap, 5 minutes")
    print(f"  padwatch: segments, cross-spectra, all estimators with budgets {ours_us:9.2f} µs")
    print(f"  scipy, each second: welch and csd of the same matrices         {whole_us:9.1f} µs")
    print(
        f"  scipy, each second: welch and csd in each direction alone      {directions_us:9.1f} µs"
    )
    ratio = whole_us / ours_us
    print(f"  {ratio:.0f} times cheaper, required {REQUIRED_RATIO:.0f};", end=" ")
    print(f"{directions_us / ours_us:.0f} times than each direction alone")
    return 0 if ratio >= REQUIRED_RATIO else 1


if __name__ == "__main__":
    sys.exit(main())
