"""What is learned from readings holds for samples: the same verdicts, and no bias between them.

The first year of a unit's life is learned from readings. In the second one its condition changes
until films are five times as stiff, and then one film loses a fifth. Readings along that way are
also taken off samples at 600 Hz, through transducers, converter, calibration, blocks, monitor and
estimator; `benchmarks/chain.py` does so with all of them.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from acquisition.simulated.life.truth import UnitLife
from benchmarks.chain import MOST_BIAS, STORY, Verdicts, judged, without_scatter
from benchmarks.chain_story import ROWS_PER_H, Watch, from_readings, silenced, windows
from benchmarks.chain_unit import readings
from benchmarks.detection_unit import LearnedUnit
from core.change.film_reading import FilmReading

pytestmark = [pytest.mark.long, pytest.mark.timeout(900)]

AROUND_CHANGE = (20, 46, 84)
"""Readings before, while and after the condition changes."""

DAMAGED = round(STORY.damage_h * ROWS_PER_H)
AFTER_DAMAGE = tuple(range(DAMAGED + 2, DAMAGED + 14))
WITHIN = 8 * ROWS_PER_H
"""Readings within which the loss must be announced."""


@dataclass(frozen=True)
class Day:
    """The same day told by readings alone, and with some of them taken off samples."""

    life: UnitLife
    rows: list[int]
    given: list[list[FilmReading]]
    mixed: list[list[FilmReading]]


@pytest.fixture(scope="module")
def day() -> Day:
    life = STORY.life()
    rows = STORY.rows(life)
    given = [from_readings(life, row) for row in rows.tolist()]
    mixed = list(given)
    for number in (*AROUND_CHANGE, *AFTER_DAMAGE):
        (window,) = windows(life, rows[number : number + 1])
        mixed[number] = silenced(readings(window), life, int(rows[number]))
    return Day(life, rows.tolist(), given, mixed)


@pytest.fixture(scope="module")
def verdicts(day: Day) -> tuple[Verdicts, Verdicts]:
    learned = LearnedUnit(STORY.seed)
    given, mixed = (
        judged(Watch(learned, day.life, day.rows[0]), moments) for moments in (day.given, day.mixed)
    )
    return given, mixed


def test_stiffness_off_samples_is_that_of_readings_within_its_uncertainty(day):
    numbers = (*AROUND_CHANGE, *AFTER_DAMAGE)
    sampled = [[v for reading in day.mixed[n] for v in reading.values] for n in numbers]
    exact = without_scatter(day.life, [day.rows[n] for n in numbers]).T
    error = np.array([[v.ln_k for v in row] for row in sampled]) - exact
    ratio = error / np.array([[v.u_random for v in row] for row in sampled])

    assert abs(np.mean(error)) < MOST_BIAS
    assert np.max(np.abs(np.mean(error, axis=0))) < 3.0 * MOST_BIAS
    assert 0.7 < np.sqrt(np.mean(ratio**2)) < 1.4
    assert np.max(np.abs(ratio)) < 5.0


def test_the_condition_change_raises_nothing_and_the_loss_is_announced_at_the_same_place(verdicts):
    given, mixed = verdicts
    for place in given.said:
        first, again = given.first_alarm(place), mixed.first_alarm(place)
        assert (first is None) == (again is None) == (place[0] != STORY.bearing), place
        if first is not None and again is not None:
            assert DAMAGED < first < DAMAGED + WITHIN
            assert abs(again - first) <= 3
            assert given.highest(place) == mixed.highest(place)
            # both probes that read a quarter more would move the shaft much alike
            assert given.cause[place] == mixed.cause[place] in ("film", "unknown")
