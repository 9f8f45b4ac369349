"""What simulated lives are like, and what they cost.

    python -m benchmarks.life [--units 20] [--years 2] [--first-seed 0]

One row per bearing, medians over the units. The range is that of the film's true stiffness between
the 0.5th and the 99.5th percentile, in the direction where it is wider.
"""

import argparse
import time

import numpy as np

from acquisition.simulated.life.life import live
from acquisition.simulated.life.truth import UnitLife
from core.baseline.history import ReadingOutcome
from core.units import NS_PER_S

START_NS = 1_735_689_600 * NS_PER_S
COLUMNS = (
    "k, GN/m",
    "range, ×",
    "ecc. 5 %",
    "ecc. 95 %",
    "oil 5 %, °C",
    "oil 95 %, °C",
    "shaft, µm pk",
    "bearing, µm pk",
    "measured, %",
)


def row(life: UnitLife, bearing: str) -> list[float]:
    """Figures of one bearing in the order of `COLUMNS`."""
    readings, truth = life.readings[bearing], life.truth[bearing]
    low, high = np.percentile(truth.ln_k, [0.5, 99.5], axis=1)
    return [
        float(np.exp(np.median(truth.ln_k))) / 1e9,
        float(np.exp(np.max(high - low))),
        *np.percentile(readings.eccentricity_ratio, [5.0, 95.0]),
        *np.percentile(readings.oil_temperature_c, [5.0, 95.0]),
        float(np.nanmedian(readings.shaft_um_pk)),
        float(np.nanmedian(readings.bearing_um_pk)),
        100.0 * float(np.mean(readings.outcome == ReadingOutcome.MEASURED)),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description="What simulated lives are like, and cost.")
    parser.add_argument("--units", type=int, default=20)
    parser.add_argument("--years", type=float, default=2.0)
    parser.add_argument("--first-seed", type=int, default=0)
    given = parser.parse_args()
    found: dict[str, list[list[float]]] = {}
    n_readings, began_s = 0, time.process_time()
    for seed in range(given.first_seed, given.first_seed + given.units):
        life = live(seed, START_NS, given.years)
        n_readings += sum(len(readings) for readings in life.readings.values())
        for bearing in life.readings:
            found.setdefault(bearing, []).append(row(life, bearing))
    took_s = time.process_time() - began_s
    print("    " + "".join(f"{name:>15}" for name in COLUMNS))
    for bearing, rows in found.items():
        print(f"{bearing:4}" + "".join(f"{x:15.2f}" for x in np.median(rows, axis=0)))
    print(f"{given.units} units × {given.years:g} years, {n_readings / 1e6:.1f} million readings:")
    print(f"{took_s:.1f} s of processor time with these figures")


if __name__ == "__main__":
    main()
