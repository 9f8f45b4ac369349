"""What a change of stiffness is put down to, and how a machine's shaft answers to one."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from core.baseline.history import StiffnessHistory
from core.change.cause import PROBE_REASON, Attribution, Cause, UnitReadings, attribute
from core.change.shaft_response import MEAN_READINGS, ShaftResponse, film_columns, learn_response

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
    response: ShaftResponse,
    row: int,
    seed: int = 2,
    rise: float = 0.0,
    **changes: Mapping[int, float],
) -> Attribution:
    """Cause of a change, from a day's readings of a machine that was changed.

    Parameters
    ----------
    rise
        Of the baseline with ln of the eccentricity, which a probe that reads more seems to raise.
    """
    healthy, changed = film_columns(machine(seed)), film_columns(machine(seed, **changes))
    further = np.zeros(6)
    for probe, gain in changes.get("probe", {}).items():
        further[probe - probe % 2 : probe - probe % 2 + 2] += 0.5 * np.log(gain)  # at 45 degrees
    deviation = changed[0] - healthy[0] - rise * further[:, np.newaxis]
    steep, attitude_deg = np.full((6, N), rise), np.full((6, N), 45.0)
    readings = UnitReadings(*changed, deviation, steep, attitude_deg)
    newest = np.arange(100, 100 + MEAN_READINGS)
    return attribute(PLACES[row], response, readings.columns(newest), BRACKETS_N_PER_M)


@pytest.mark.parametrize(("row", "is_named"), [(0, True), (3, True), (4, False)])
@pytest.mark.parametrize("factor", [0.8, 0.7])
def test_a_softer_film_is_the_film_unless_probes_would_do_the_same(response, row, is_named, factor):
    pair = {row: factor, row ^ 1: factor}
    found = put_down(response, row, film=pair)
    assert found.cause is (Cause.FILM if is_named else Cause.UNKNOWN)
    assert found.film_share == pytest.approx(1.0, abs=0.3)
    assert found.shaft_change is not None
    assert found.shaft_change > 0.02


def test_a_stiffer_film_is_the_film_and_two_faults_at_once_have_no_single_cause(response):
    assert put_down(response, 0, film={0: 1.3, 1: 1.3}).cause is Cause.FILM
    found = put_down(response, 0, film={0: 0.75, 1: 0.75}, accelerometer={0: 0.75, 1: 0.75})
    assert found.cause is Cause.UNKNOWN


@pytest.mark.parametrize("row", range(6))
def test_an_accelerometer_that_lost_a_fifth_is_not_the_film(response, row):
    found = put_down(response, row, accelerometer={row: 0.8})
    assert found.cause is Cause.BRACKET_OR_TRANSDUCER
    assert found.film_share == pytest.approx(0.0, abs=0.2)
    assert found.bearing_change == pytest.approx(np.log(0.8), abs=0.03)


NOT_FILMS = [
    *((row, {"probe": {row: 1.25}}) for row in range(6)),
    *((row, {"probe": {row: 1.15, row + 1: 1.15}}) for row in (0, 2, 4)),
    *((row, {"bracket": {row: 0.7, row + 1: 0.7}}) for row in (0, 2, 4)),
]


@pytest.mark.parametrize("seed", range(2, 5))
@pytest.mark.parametrize(("row", "changes"), NOT_FILMS)
def test_probes_that_read_more_and_loose_brackets_are_never_the_film(response, row, changes, seed):
    found = put_down(response, row, seed, **changes)
    assert found.cause in (Cause.BRACKET_OR_TRANSDUCER, Cause.UNKNOWN)
    assert found.film_share is None or found.film_share < 1.0 + 2.0 * found.film_share_std


@pytest.mark.parametrize(
    ("row", "changes"), [NOT_FILMS[0], NOT_FILMS[6], NOT_FILMS[7], NOT_FILMS[9]]
)
def test_probes_and_brackets_are_named_where_no_film_moves_the_shaft_so(response, row, changes):
    found = put_down(response, row, **changes)
    assert found.cause is Cause.BRACKET_OR_TRANSDUCER


def test_a_probe_that_reads_more_is_recognised_though_its_shaft_seems_further_out(response):
    """Where stiffness rises with eccentricity, the film seems softer in y too."""
    found = put_down(response, 2, probe={2: 1.25}, rise=1.0)
    assert (found.cause, found.reason) == (Cause.BRACKET_OR_TRANSDUCER, PROBE_REASON)


@pytest.mark.parametrize("seed", range(2, 10))
@pytest.mark.parametrize("factor", [0.9, 0.8, 1.25])
@pytest.mark.parametrize("what", ["film", "accelerometer"])
def test_a_like_change_in_all_bearings_is_oil_or_not_known(response, what, factor, seed):
    found = put_down(response, 0, seed, **{what: dict.fromkeys(range(6), factor)})
    assert found.cause in (Cause.OIL, Cause.UNKNOWN)
    assert what == "film" or found.cause is Cause.UNKNOWN


def test_a_small_change_or_one_without_response_or_readings_has_no_cause(response):
    shares = [put_down(response, 0, seed, film={0: 0.995}) for seed in range(3, 6)]
    assert {found.cause for found in shares} <= {Cause.UNKNOWN, Cause.FILM}
    assert any(found.cause is Cause.UNKNOWN for found in shares)
    nothing = UnitReadings(*np.full((5, 6, 3), np.nan))
    assert attribute(PLACES[0], response, nothing).cause is Cause.UNKNOWN
    assert attribute(PLACES[0], None, nothing).cause is Cause.UNKNOWN
    assert attribute(("XJB", "x"), response, nothing).cause is Cause.UNKNOWN


N_POINTS = 3000


def histories(seed: int, outliers: float = 0.0) -> dict[str, StiffnessHistory]:
    """Two bearings; the first one's shaft motion falls by half of what its stiffness rises."""
    random = np.random.default_rng(seed)
    ln_k = 20.0 + random.normal(0.0, 0.3, (4, N_POINTS))
    unbalance = random.normal(0.0, 0.2, N_POINTS)
    ln_shaft = 4.0 + unbalance - 0.5 * (ln_k - 20.0) + 0.1 * (ln_k - 20.0) ** 2
    ln_shaft += random.normal(0.0, 0.01, ln_k.shape)
    ln_shaft += np.where(random.random(ln_k.shape) < outliers, 1.0, 0.0)
    one, pair = np.ones(N_POINTS), np.full((2, N_POINTS), 0.01)
    return {
        name: StiffnessHistory(
            *(np.arange(N_POINTS), one, one, one, one, one, one, ln_k[rows], pair),
            *(np.exp(ln_shaft[rows]), np.exp(ln_shaft[rows])),
        )
        for name, rows in (("UJB", slice(0, 2)), ("LJB", slice(2, 4)))
    }


def learned(seed: int, outliers: float = 0.0) -> ShaftResponse:
    found = learn_response(histories(seed, outliers), np.ones(N_POINTS, np.bool_))
    assert found is not None
    return found


def test_shares_follow_from_stiffness_and_wrong_or_too_few_readings_teach_nothing():
    ln_k, ln_shaft = film_columns(histories(2))
    left = ln_shaft - np.mean(ln_shaft, axis=0) - learned(1).expected(ln_k)
    assert np.std(left) == pytest.approx(0.01, rel=0.2)
    assert np.mean(left, axis=1) == pytest.approx(0.0, abs=1e-3)
    ln_k, _ = film_columns(histories(2))
    shift = learned(1, outliers=0.05).expected(ln_k) - learned(1).expected(ln_k)
    assert np.max(np.abs(np.median(shift, axis=1))) < 0.002
    assert learn_response(histories(1), np.arange(N_POINTS) < 500) is None


def test_a_response_needs_bearings_read_at_the_same_times():
    found = histories(1)
    found["LJB"] = replace(found["LJB"], time_ns=found["LJB"].time_ns + 1)
    with pytest.raises(ValueError, match="LJB must be at the times"):
        learn_response(found, np.ones(N_POINTS, np.bool_))
