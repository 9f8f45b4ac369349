"""Pad temperatures show on which side of a bearing the load is."""

import pytest

from core.condition.shaft_readings import DIRECTION, EXCESS, MEAN, VECTOR, pad_pattern
from core.quality import Level, Reading, Reason, missing

ANGLES_DEG = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)
WARM = (61.0, 65.0, 63.0, 57.0, 53.0, 55.0)
"""Mean 59 °C; cosines and sines of a load towards about 70°, with a little else."""


def pads(*temperatures: float | None) -> list[tuple[Reading, float | None]]:
    broken = missing(Reason.OUT_OF_RANGE)
    found = (broken if value is None else Reading(value) for value in temperatures)
    return list(zip(found, ANGLES_DEG, strict=True))


def test_a_load_towards_a_pad_is_its_excess_and_a_vector_towards_it():
    cosine = [60.0 + 4.0 * c for c in (0.5, 1.0, 0.5, -0.5, -1.0, -0.5)]

    found = pad_pattern(pads(*cosine))

    assert [found[name].value for name in (MEAN, EXCESS, VECTOR, DIRECTION)] == pytest.approx(
        [60.0, 4.0, 4.0, 60.0]
    )
    assert {reading.quality.level for reading in found.values()} == {Level.GOOD}


def test_a_broken_thermometer_leaves_the_vector_of_the_others_uncertain():
    cosine = [60.0 + 4.0 * c for c in (0.5, 1.0, 0.5, -0.5, -1.0)]

    found = pad_pattern(pads(*cosine, None))

    assert [found[VECTOR].value, found[DIRECTION].value] == pytest.approx([4.0, 60.0])
    assert {r.quality.reason for r in found.values()} == {Reason.REDUCED_PROBES}


def test_pads_on_one_side_alone_give_no_vector():
    found = pad_pattern(pads(*WARM[:3], None, None, None)[:3])
    assert found[EXCESS].value == pytest.approx(2.0)
    near = [(Reading(60.0 + n), 10.0 * n) for n in range(3)]
    assert pad_pattern(near)[VECTOR] == missing(Reason.REDUCED_PROBES)


def test_without_pads_or_angles_there_is_no_pattern():
    assert {r.quality.reason for r in pad_pattern([]).values()} == {Reason.NOT_MEASURED}
    one = pad_pattern(pads(60.0, *[None] * 5))
    assert {r.quality.reason for r in one.values()} == {Reason.OUT_OF_RANGE}
    unplaced = pad_pattern([(Reading(value), None) for value in WARM])
    assert unplaced[EXCESS].value == pytest.approx(6.0)
    assert unplaced[VECTOR] == missing(Reason.NOT_MEASURED)
