"""What a change of stiffness is put down to."""

from collections.abc import Mapping

import numpy as np
import pytest

from core.baseline.response import (
    MEAN_READINGS,
    ShaftResponse,
    learn_response,
    place_columns,
)
from core.decision.attribution import Attribution, Cause, attribute
from core.stiffness_history import StiffnessHistory

BEARINGS = ("UJB", "LJB", "TJB")
PLACES = tuple((bearing, direction) for bearing in BEARINGS for direction in "xy")
BRACKETS_N_PER_M = np.full(6, 1.0e9)
N = 4000


def shaft_um_pk(k: np.ndarray, bracket: np.ndarray, grade: np.ndarray) -> np.ndarray:
    """A rigid shaft on three springs: what it moves by in each, alike in both directions."""
    support = 1.0 / (1.0 / k + 1.0 / bracket)
    height_m = np.array([5.4, 5.4, 0.1, 0.1, -8.8, -8.8])[:, np.newaxis]
    motion = np.empty_like(k)
    for rows in (slice(0, 6, 2), slice(1, 6, 2)):
        s, h = support[rows], height_m[rows]
        a, b, d = s.sum(axis=0), (s * h).sum(axis=0), (s * h * h).sum(axis=0)
        total = (d - b * h) / (a * d - b * b)
        motion[rows] = total * s / k[rows]
    return 1e9 * grade * motion


def machine(
    seed: int,
    film: Mapping[int, float] | None = None,
    accelerometer: Mapping[int, float] | None = None,
    probe: Mapping[int, float] | None = None,
    bracket: Mapping[int, float] | None = None,
) -> dict[str, StiffnessHistory]:
    """Readings of a machine whose films wander; what changes holds for all of it.

    Factors are by place.
    """

    def factors(of: Mapping[int, float] | None) -> np.ndarray:
        return np.array([(of or {}).get(row, 1.0) for row in range(6)])[:, np.newaxis]

    random = np.random.default_rng(seed)
    wander = np.repeat(random.normal(0.0, 0.4, (6, N // 40)), 40, axis=1)
    k = 0.5e9 * np.exp(wander) * factors(film)
    true_bracket = BRACKETS_N_PER_M[:, np.newaxis] * factors(bracket)
    grade = np.exp(np.repeat(random.normal(0.0, 0.2, N // 200), 200))
    shaft = shaft_um_pk(k, true_bracket, grade)
    bearing = shaft * k / true_bracket * factors(accelerometer)
    shaft = shaft * factors(probe) * np.exp(random.normal(0.0, 0.01, k.shape))
    ln_k = np.log(bearing / shaft * BRACKETS_N_PER_M[:, np.newaxis])
    ln_k += random.normal(0.0, 0.01, k.shape)
    one = np.ones(N)
    return {
        name: StiffnessHistory(
            *(np.arange(N), one, one, one, one, one, one, ln_k[rows], np.full((2, N), 0.01)),
            *(shaft[rows], bearing[rows]),
        )
        for name, rows in zip(BEARINGS, (slice(0, 2), slice(2, 4), slice(4, 6)), strict=True)
    }


@pytest.fixture(scope="module")
def response() -> ShaftResponse:
    found = learn_response(machine(1), np.ones(N, np.bool_))
    assert found is not None
    return found


def put_down(
    response: ShaftResponse, row: int, seed: int = 2, **changes: Mapping[int, float]
) -> Attribution:
    """Cause of a change, from a day's readings of a machine that was changed."""
    healthy, changed = place_columns(machine(seed)), place_columns(machine(seed, **changes))
    newest = slice(100, 100 + MEAN_READINGS)
    return attribute(
        PLACES[row],
        response,
        changed[0][:, newest],
        changed[1][:, newest],
        (changed[0] - healthy[0])[:, newest],
        BRACKETS_N_PER_M,
    )


@pytest.mark.parametrize("row", [0, 3, 4])
@pytest.mark.parametrize("factor", [0.8, 0.7])
def test_a_softer_film_moves_the_shaft_and_is_the_film(
    response: ShaftResponse, row: int, factor: float
) -> None:
    pair = {row: factor, row ^ 1: factor}
    found = put_down(response, row, film=pair)
    assert found.cause is Cause.FILM
    assert found.film_share == pytest.approx(1.0, abs=0.3)
    assert found.shaft_change is not None
    assert found.shaft_change > 0.02


def test_a_film_that_becomes_stiffer_is_the_film_and_with_a_weak_accelerometer_both(
    response: ShaftResponse,
) -> None:
    assert put_down(response, 0, film={0: 1.3, 1: 1.3}).cause is Cause.FILM
    found = put_down(response, 0, film={0: 0.75, 1: 0.75}, accelerometer={0: 0.75, 1: 0.75})
    assert found.cause is Cause.BOTH


@pytest.mark.parametrize("row", range(6))
def test_an_accelerometer_that_lost_a_fifth_is_not_the_film(
    response: ShaftResponse, row: int
) -> None:
    found = put_down(response, row, accelerometer={row: 0.8})
    assert found.cause is Cause.BRACKET_OR_TRANSDUCER
    assert found.film_share == pytest.approx(0.0, abs=0.2)
    assert found.bearing_change == pytest.approx(np.log(0.8), abs=0.03)


@pytest.mark.parametrize(
    ("row", "changes"),
    [
        *((row, {"probe": {row: 1.25}}) for row in range(6)),
        *((row, {"bracket": {row: 0.7, row + 1: 0.7}}) for row in (0, 2, 4)),
        (0, {"accelerometer": dict.fromkeys(range(6), 0.8)}),
    ],
)
def test_a_probe_that_reads_more_loose_brackets_and_weak_accelerometers_are_not_the_film(
    response: ShaftResponse, row: int, changes: Mapping[str, Mapping[int, float]]
) -> None:
    assert put_down(response, row, **changes).cause is Cause.BRACKET_OR_TRANSDUCER


def test_a_small_change_or_one_without_response_or_readings_has_no_cause(
    response: ShaftResponse,
) -> None:
    shares = [put_down(response, 0, seed, film={0: 0.995}) for seed in range(3, 6)]
    assert {found.cause for found in shares} <= {Cause.UNKNOWN, Cause.FILM}
    assert any(found.cause is Cause.UNKNOWN for found in shares)
    nothing = np.full((6, 3), np.nan)
    assert attribute(PLACES[0], response, nothing, nothing, nothing).cause is Cause.UNKNOWN
    assert attribute(PLACES[0], None, nothing, nothing, nothing).cause is Cause.UNKNOWN
    assert attribute(("XJB", "x"), response, nothing, nothing, nothing).cause is Cause.UNKNOWN
