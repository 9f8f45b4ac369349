"""How true the estimators are: Monte Carlo over simulated recordings, required beside found.

``python benchmarks/accuracy.py`` runs every row; ``--row NAME`` one, ``--runs N`` fewer. Every run
is seeded. Ends with 1 if a requirement is not met.
"""

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.accuracy_estimates import Estimate, amplitudes, estimates
from benchmarks.accuracy_plant import FlexibleRun, flexible_spectra, spectra
from benchmarks.accuracy_rows import ROWS, Required, Row
from core.arrays import FloatArray

SINGLE_THREADED = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""For the workers: they are the parallelism."""

HEADINGS = (
    *("bearing", "figure", "required, %", "mean", "scatter", "worst"),
    *("stated", "covers", "random", "n", "verdict"),
)


@dataclass(frozen=True)
class Found:
    """One figure of one bearing over all runs; relative numbers."""

    figure: str
    errors: FloatArray
    covered: float
    covered_random: float
    std: float

    @property
    def mean(self) -> float:
        return float(np.mean(self.errors)) if self.errors.size else float("nan")

    @property
    def worst(self) -> float:
        return float(np.max(np.abs(self.errors))) if self.errors.size else float("nan")

    @property
    def scatter(self) -> float:
        return float(np.std(self.errors)) if self.errors.size else float("nan")


def simulate(job: tuple[str, int]) -> dict[str, list[Estimate]]:
    """Evaluate one run of a row, by bearing."""
    row = ROWS[job[0]]
    if isinstance(row.run, FlexibleRun):
        found = flexible_spectra(row.run, job[1])
    else:
        found = spectra(row.run, job[1], row.response)
    if not row.mass_known:
        found = {
            bearing: replace(of, bracket=replace(of.bracket, mass_kg=None))
            for bearing, of in found.items()
        }
    if row.amplitudes:
        return {bearing: amplitudes(found[bearing]) for bearing in row.bearings}
    return {
        bearing: estimates(
            found[bearing],
            row.accuracy,
            row.lines,
            row.c_over_k_xx,
            row.runout_um_pk,
            good_only=isinstance(row.run, FlexibleRun),
        )
        for bearing in row.bearings
    }


def gather(runs: list[dict[str, list[Estimate]]]) -> Iterator[tuple[str, Found]]:
    """Statistics of each bearing and figure, and of all coefficients of `dynamic` together."""
    for bearing, first in runs[0].items():
        names = [estimate.name for estimate in first]
        figures_of = {name: [place] for place, name in enumerate(names)}
        of_dynamic = [place for place, name in enumerate(names) if name.startswith("dynamic ")]
        if of_dynamic:
            figures_of["dynamic together"] = of_dynamic
        for name, places in figures_of.items():
            all_runs = [run[bearing][place] for run in runs for place in places]
            given = [e for e in all_runs if np.isfinite(e.error)]
            yield (
                bearing,
                Found(
                    name,
                    np.array([e.error for e in given]),
                    float(np.mean([e.covered for e in given])) if given else float("nan"),
                    float(np.mean([e.covered_random for e in given])) if given else float("nan"),
                    float(np.mean([e.std for e in given])) if given else float("nan"),
                ),
            )


def misses(found: Found, required: Required) -> list[str]:
    """Name what is required and not met."""
    if required.silent:
        return ["silent"] if found.errors.size else []
    checks = {
        "mean": required.mean is None or abs(found.mean) <= required.mean,
        "scatter": required.scatter is None or found.scatter <= required.scatter,
        "worst": required.worst is None or found.worst <= required.worst,
        "coverage": required.coverage is None
        or not found.errors.size
        or required.coverage[0] <= found.covered <= required.coverage[1],
        "random coverage": required.random_coverage is None
        or required.random_coverage[0] <= found.covered_random <= required.random_coverage[1],
    }
    return [name for name, met in checks.items() if not met]


def wanted(required: Required) -> str:
    """What is required, in words."""
    if required.silent:
        return "silent"
    parts = []
    if required.mean is not None:
        parts.append(f"|mean| ≤ {100 * required.mean:g}")
    if required.scatter is not None:
        parts.append(f"scatter ≤ {100 * required.scatter:g}")
    if required.worst is not None:
        parts.append(f"worst ≤ {100 * required.worst:g}")
    if required.coverage is not None:
        low, high = required.coverage
        parts.append(f"covers {100 * low:g}–{100 * high:g}")
    if required.random_coverage is not None:
        low, high = required.random_coverage
        parts.append(f"random covers {100 * low:g}–{100 * high:g}")
    return ", ".join(parts) or "–"


def report(name: str, row: Row, runs: list[dict[str, list[Estimate]]], took_s: float) -> bool:
    """Print a row; tell whether all that is required was met."""
    print(f"\n## {name}: {row.title} ({len(runs)} runs, {took_s:.0f} s)\n")
    print("|", " | ".join(HEADINGS), "|")
    print("|", " | ".join(["---"] * len(HEADINGS)), "|")
    all_met = True
    for bearing, found in gather(runs):
        required = row.limits_of(found.figure)
        missed = misses(found, required)
        all_met = all_met and not missed
        verdict = "missed: " + ", ".join(missed) if missed else "met"
        cells = [bearing, found.figure, wanted(required), *figures(found)]
        print("|", " | ".join([*cells, "–" if wanted(required) == "–" else verdict]), "|")
    return all_met


def figures(found: Found) -> list[str]:
    """What was found, in percent, for the columns of the table."""
    n_given = str(found.errors.size)
    if not found.errors.size:
        return ["none", "", "", "", "", "", n_given]
    return [
        f"{100 * found.mean:+.2f}",
        f"{100 * found.scatter:.2f}",
        f"{100 * found.worst:.2f}",
        f"{100 * found.std:.2f}",
        f"{100 * found.covered:.1f}",
        f"{100 * found.covered_random:.1f}",
        n_given,
    ]


def run_row(name: str, n_runs: int, n_workers: int, seed: int) -> bool:
    """Simulate and print one row."""
    start_s, runs = time.monotonic(), []
    jobs = [(name, seed + index) for index in range(n_runs)]
    context = multiprocessing.get_context("spawn")
    with context.Pool(n_workers) as pool:
        for run in pool.imap(simulate, jobs, chunksize=1):
            runs.append(run)
            print(f"\r{name}: {len(runs)} of {n_runs}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return report(name, ROWS[name], runs, time.monotonic() - start_s)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--row", action="append", choices=[*ROWS], help="only this row; repeatable")
    parser.add_argument("--runs", type=int, help="runs of each row instead of its own number")
    parser.add_argument("--workers", type=int, default=2, choices=(1, 2))
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    os.environ.update(SINGLE_THREADED)
    print(
        "Relative errors in percent; 'stated' is the random standard uncertainty given beside it."
    )
    met = [
        run_row(name, arguments.runs or ROWS[name].n_runs, arguments.workers, arguments.seed)
        for name in arguments.row or ROWS
    ]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
