"""The whole chain at 600 Hz beside readings alone: another condition, then damage.

``python -m benchmarks.chain`` learns a simulated unit from a year of readings. In the second year a
shaft goes from near the centre in warm oil far out into cold oil, which makes films several times
as stiff, and nine hours later one film loses a fifth of its stiffness. Every reading of that day is
taken twice: as simulated lives give it, and off five minutes of samples at 600 Hz that went through
rotor, transducers, converter, calibration, blocks, monitor and estimator. The same decision runs on
both. ``--softer`` goes the other way round. Ends with 1 if the two depths disagree.
"""

import argparse
import multiprocessing
import os
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.life.truth import UnitLife
from benchmarks.chain_story import ROWS_PER_H, Story, Watch, from_readings, silenced, windows
from benchmarks.chain_unit import readings
from benchmarks.detection_unit import LearnedUnit
from core.arrays import FloatArray
from core.baseline.history import DIRECTIONS
from core.change.decision import JUDGED, Verdict
from core.change.film_judge import FilmNews
from core.change.film_reading import FilmReading
from core.change.shaft_response import FilmDirection

STORY = Story(seed=2002, day=141.0)
SINGLE_THREADED = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
MOST_BIAS = 0.001
"""Mean error off samples, in ln k, against what film and transducers of the life are like."""

MOST_APART = 0.004
"""Mean difference of the two depths: a tenth of the change that is an alert. Readings of lives
scatter by chance, by 0.0005 in the mean of a day."""

MOST_DELAY_H = 1.0
"""By which one depth may alarm later than the other."""

LEVELS = (Verdict.ALERT, Verdict.DANGER)


@dataclass(frozen=True)
class Depths:
    """The same readings at both depths, row by row."""

    life: UnitLife
    rows: list[int]
    given: list[list[FilmReading]]
    sampled: list[list[FilmReading]]


@dataclass(frozen=True)
class Verdicts:
    """What is said at one depth, (n,) by place."""

    said: dict[FilmDirection, list[Verdict]]
    cause: dict[FilmDirection, str]

    def first_alarm(self, place: FilmDirection) -> int | None:
        """Number of the reading with which an alarm begins."""
        alarmed = [n for n, verdict in enumerate(self.said[place]) if verdict in LEVELS]
        return alarmed[0] if alarmed else None

    def highest(self, place: FilmDirection) -> str:
        reached = [v for v in self.said[place] if v in LEVELS]
        return max(reached).name.lower() if reached else "none"


def judged(watch: Watch, moments: Sequence[Sequence[FilmReading]]) -> Verdicts:
    """Lead the decision on through all readings."""
    said: dict[FilmDirection, list[Verdict]] = {}
    cause: dict[FilmDirection, str] = {}
    for moment in moments:
        for place, finding in _findings(watch.judge(moment)):
            said.setdefault(place, []).append(finding[0])
            if finding[1]:
                cause[place] = finding[1]
    return Verdicts(said, cause)


def _findings(news: Sequence[FilmNews]) -> Iterator[tuple[FilmDirection, tuple[Verdict, str]]]:
    for one in news:
        for direction, finding in zip(DIRECTIONS, one.findings[: len(DIRECTIONS)], strict=True):
            cause = finding.attribution.cause.value if finding.attribution else ""
            yield (one.reading.bearing, direction), (finding.verdict, cause)


def sample(story: Story, n_processes: int) -> Depths:
    """Take all readings of a story at both depths."""
    life = story.life()
    rows = story.rows(life)
    found: list[list[FilmReading]] = []
    with multiprocessing.get_context("spawn").Pool(n_processes) as pool:
        for measured in pool.imap(readings, windows(life, rows)):
            found.append(silenced(measured, life, int(rows[len(found)])))
            if sys.stderr.isatty():
                print(f"\r{len(found)} of {rows.size}", end="", file=sys.stderr, flush=True)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    return Depths(life, rows.tolist(), [from_readings(life, row) for row in rows.tolist()], found)


def columns(depths: Depths, what: str) -> tuple[FloatArray, FloatArray]:
    """One number of all readings at both depths, (n_places, n) or (n_bearings, n)."""

    def of(moments: list[list[FilmReading]]) -> FloatArray:
        if hasattr(moments[0][0], what):
            return np.array([[getattr(r, what) for r in moment] for moment in moments]).T
        return np.array([[getattr(v, what) for r in m for v in r.values] for m in moments]).T

    return of(depths.given), of(depths.sampled)


def without_scatter(life: UnitLife, rows: list[int]) -> FloatArray:
    """(n_places, n) ln k that the life's transducers would read without any random uncertainty."""
    found: list[FloatArray] = []
    for truth in life.truth.values():
        chain, altered = truth.chain, truth.altered
        bearing = chain.accelerometer_gain[:, np.newaxis] * altered.accelerometer_gain
        probe = chain.probe_gain[:, np.newaxis] * altered.probe_gain
        apparent = np.log(bearing / probe / altered.bracket)
        found += list((truth.ln_k + apparent + chain.ln_k_error)[:, rows])
    return np.array(found)


def compare(depths: Depths, places: list[FilmDirection]) -> bool:
    """Print how far the depths differ, reading by reading; False if one is biased."""
    given, sampled = columns(depths, "ln_k")
    u_given, u_sampled = columns(depths, "u_random")
    exact = without_scatter(depths.life, depths.rows)
    shaft, bearing = (columns(depths, f"{name}_um_pk") for name in ("shaft", "bearing"))
    heads = ("ln k, mean", "rms / u", "largest / u", "to truth", "rms / u", "u, %", "u given, %")
    print(f"{'':8}" + "".join(f"{head:>13}" for head in (*heads, "1× shaft, %", "1× bear., %")))
    is_fair = True
    for i, (name, direction) in enumerate(places):
        apart, error = sampled[i] - given[i], sampled[i] - exact[i]
        ratio = apart / np.hypot(u_given[i], u_sampled[i])
        amplitudes = (np.nanmedian(s[i] / g[i]) - 1.0 for g, s in (shaft, bearing))
        figures = (
            *(np.nanmean(apart), _rms(ratio), np.nanmax(np.abs(ratio))),
            *(np.nanmean(error), _rms(error / u_sampled[i])),
            *(100.0 * np.nanmedian(u[i]) for u in (u_sampled, u_given)),
            *(100.0 * amplitude for amplitude in amplitudes),
        )
        print(f"{name} {direction:4}" + "".join(f"{x:13.4f}" for x in figures))
        is_fair &= bool(abs(figures[0]) < MOST_APART and abs(figures[3]) < MOST_BIAS)
    _print_conditions(depths, [name for name, direction in places if direction == "x"])
    return is_fair


def _print_conditions(depths: Depths, bearings: list[str]) -> None:
    names = ("eccentricity_ratio", "attitude_deg", "oil_temperature_c", "speed_rpm", "power_mw")
    print("\nlargest difference" + "".join(f"{name:>20}" for name in names))
    apart = [np.abs(np.subtract(*columns(depths, name))) for name in names]
    for i, bearing in enumerate(bearings):
        print(f"{bearing:18}" + "".join(f"{np.nanmax(column[i]):20.4f}" for column in apart))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def agree(story: Story, given: Verdicts, sampled: Verdicts) -> bool:
    """Print what is said at both depths; False if it is not the same."""
    print(f"\n{'':8}{'readings alone':>40}{'600 Hz':>40}{'same verdict':>14}")
    is_same = True
    for place, verdicts in given.said.items():
        alike = np.mean(np.array(verdicts) == np.array(sampled.said[place]))
        first = [depth.first_alarm(place) for depth in (given, sampled)]
        words = [_words(story, depth, place) for depth in (given, sampled)]
        print(f"{' '.join(place):8}{words[0]:>40}{words[1]:>40}{100.0 * alike:12.1f} %")
        is_same &= _is_same(story, place, *first)
        is_same &= given.highest(place) == sampled.highest(place)
    return is_same


def _is_same(story: Story, place: FilmDirection, given: int | None, sampled: int | None) -> bool:
    if given is None or sampled is None:
        return given is sampled
    is_early = min(given, sampled) < story.damage_h * ROWS_PER_H
    is_there = place[0] == story.bearing
    return is_there and not is_early and abs(given - sampled) <= MOST_DELAY_H * ROWS_PER_H


def _words(story: Story, depth: Verdicts, place: FilmDirection) -> str:
    first = depth.first_alarm(place)
    if first is None:
        share = np.mean([verdict in JUDGED for verdict in depth.said[place]])
        return f"no alarm, {100.0 * share:.0f} % judged"
    after_h = first / ROWS_PER_H - story.damage_h
    return f"{depth.highest(place)} {after_h:+.1f} h, {depth.cause.get(place, '')}"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--softer", action="store_true", help="let films become softer instead")
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    os.environ.update(SINGLE_THREADED)
    story = Story(STORY.seed, STORY.day, stiffer=not options.softer)
    began = time.monotonic()
    depths = sample(story, options.processes)
    took_s = time.monotonic() - began
    learned = LearnedUnit(story.seed)
    given, sampled = (
        judged(Watch(learned, depths.life, depths.rows[0]), moments)
        for moments in (depths.given, depths.sampled)
    )
    is_fair = compare(depths, list(given.said))
    is_same = agree(story, given, sampled)
    print(
        f"\n{len(depths.rows)} readings of unit {story.seed} at 600 Hz in {took_s:.0f} s:"
        f" {'same verdicts' if is_same else 'VERDICTS DIFFER'},"
        f" {'no bias' if is_fair else 'BIASED'}"
    )
    return 0 if is_fair and is_same else 1


if __name__ == "__main__":
    sys.exit(main())
