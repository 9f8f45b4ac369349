"""How early changes of films are found, and how rarely anything is said of healthy ones.

``python benchmarks/detection.py`` lets five plants of twenty units live for two years: the first is
learned, the second decided on. ``--plants`` and ``--units`` take fewer, ``--tuning`` the plant that
settings were tuned on instead of those reported. The fixed threshold beside is given the narrowest
band that alarms as rarely as is required on these very units. Everything is seeded. Ends with 1 if
a requirement is not met.
"""

import argparse
import multiprocessing
import multiprocessing.pool
import os
import sys
import time
from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

from benchmarks.detection_cases import (
    DAMAGE_CASES,
    change_condition,
    false_alarms,
    find_damage,
    leave_support,
)
from benchmarks.detection_causes import CAUSE_CASES, judged_per_day, tell
from benchmarks.detection_fixed import BANDS
from benchmarks.detection_table import HEADINGS, MOST_FALSE_ALARMS, Line, UnitResult, lines
from benchmarks.detection_unit import LearnedUnit, fixed_false_alarms

SINGLE_THREADED = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""For the workers: they are the parallelism."""

TWO_SHIFT_EVERY = 5
"""One of so many units lives a second time, with two runs a day."""

REPORTED_PLANTS, TUNING_PLANT = (1, 2, 3, 4, 5), 900

Job = TypeVar("Job")
Result = TypeVar("Result")


def unit_seeds(plant: int, n_units: int) -> list[int]:
    return [1000 * plant + unit for unit in range(n_units)]


def examine(job: tuple[int, float]) -> UnitResult:
    """Everything that is done to one unit."""
    seed, band = job
    unit = LearnedUnit(seed)
    random = np.random.default_rng([seed, 7])
    return UnitResult(
        unit.healthy.years,
        false_alarms(unit, band),
        {case.name: find_damage(unit, case, random, band) for case in DAMAGE_CASES},
        tuple(change_condition(unit, stiffer, random, band) for stiffer in (True, False)),
        {damaged: leave_support(unit, damaged, random, band) for damaged in (False, True)},
        {case.name: tell(unit, case, random) for case in CAUSE_CASES},
        judged_per_day(seed) if seed % TWO_SHIFT_EVERY == 0 else None,
    )


def fitting_band(results: Sequence[tuple[float, list[int]]]) -> float:
    """The narrowest fixed band that alarms as rarely as is required."""
    years = sum(years for years, _ in results)
    rates = np.sum([alarms for _, alarms in results], axis=0) / years
    is_quiet = np.flatnonzero(rates <= MOST_FALSE_ALARMS)
    return float(BANDS[is_quiet[0] if is_quiet.size else -1])


def run(
    pool: multiprocessing.pool.Pool, work: Callable[[Job], Result], jobs: list[Job], name: str
) -> list[Result]:
    """Results of all jobs, with a line of progress on a terminal."""
    found = []
    for result in pool.imap(work, jobs):
        found.append(result)
        if sys.stderr.isatty():
            print(f"\r{name}: {len(found)} of {len(jobs)}", end="", file=sys.stderr, flush=True)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    return found


def print_table(table: Sequence[Line]) -> None:
    verdicts = {None: "", True: "met", False: "MISSED"}
    rows = [HEADINGS] + [
        (x.case, x.required, x.found, str(x.n), x.fixed, verdicts[x.is_met]) for x in table
    ]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADINGS))]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        print("  ".join(cells).rstrip())


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=20, help="units of each plant")
    parser.add_argument("--plants", type=int, default=len(REPORTED_PLANTS), help="plants")
    parser.add_argument("--tuning", action="store_true", help="take the plant of the tuning")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    os.environ.update(SINGLE_THREADED)
    began = time.monotonic()
    plants = (TUNING_PLANT,) if options.tuning else REPORTED_PLANTS[: options.plants]
    seeds = [seed for plant in plants for seed in unit_seeds(plant, options.units)]
    with multiprocessing.get_context("spawn").Pool(options.workers) as pool:
        band = fitting_band(run(pool, fixed_false_alarms, seeds, "fixed threshold"))
        results = run(pool, examine, [(seed, band) for seed in seeds], "units")
    table = list(lines(results))
    print_table(table)
    print(
        f"\nplants {', '.join(map(str, plants))} of {options.units} units; fixed threshold at a"
        f" factor of {np.exp(band):.2f} either way; {time.monotonic() - began:.0f} s"
    )
    return 1 if any(line.is_met is False for line in table) else 0


if __name__ == "__main__":
    sys.exit(main())
