"""Laws that a baseline obeys, columns that it refuses, and drift told from seasons and chance."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from core.baseline.agreement import Drift, drift_within, learning_drift
from core.baseline.baseline import BearingBaseline, Origin, QuantityBaseline
from core.baseline.cell_table import Support, cells_between, neighbourhood
from core.baseline.history import ReadingOutcome, StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.baseline.surface_fit import slope_scatter
from core.condition.cells import CellGrid, FilmConditions

ORIGIN = Origin("U1", "UJB", "dynamic", 1, "Ada", 1_700_000_000_000_000_000, "commissioning")
FilmLife = Callable[..., StiffnessHistory]


def baseline_of(
    history: StiffnessHistory, settings: BaselineSettings | None = None
) -> BearingBaseline:
    settled = np.ones(len(history), np.bool_)
    return learn(history, settled, ORIGIN, settings or BaselineSettings())


def learned(
    history: StiffnessHistory, settings: BaselineSettings | None = None
) -> QuantityBaseline:
    found = baseline_of(history, settings).of("k_x")
    assert found is not None
    return found


def deviation(baseline: QuantityBaseline, history: StiffnessHistory) -> np.ndarray:
    conditions = history.conditions
    return baseline.compare(conditions, history.ln_k[0], history.u_random[0]).deviation


def with_ln_k(history: StiffnessHistory, ln_k: np.ndarray) -> StiffnessHistory:
    return replace(history, ln_k=ln_k)


@pytest.fixture(scope="module")
def healthy(film_life: FilmLife) -> StiffnessHistory:
    return film_life(1)


def test_what_never_changes_is_its_own_baseline_and_a_stiffer_bracket_moves_both(healthy):
    constant = learned(with_ln_k(healthy, np.full_like(healthy.ln_k, 20.0)))
    heights = constant.surface.at(healthy.conditions)
    assert np.allclose(heights, 20.0, rtol=0.0, atol=1e-9)
    assert {cell.location for cell in constant.table.cells} == {20.0}
    moved = with_ln_k(healthy, healthy.ln_k + 0.5)
    before, after = learned(healthy), learned(moved)
    same = deviation(before, healthy)
    np.testing.assert_allclose(deviation(before, moved) - same, np.where(np.isnan(same), same, 0.5))
    np.testing.assert_allclose(deviation(after, moved), same, atol=1e-6)


def test_the_order_of_the_days_does_not_change_what_is_normal(healthy):
    day = healthy.time_ns // 86_400_000_000_000
    days = np.unique(day)
    target = dict(zip(days, np.random.default_rng(3).permutation(days), strict=True))
    shift = np.array([target[d] - d for d in day]) * 86_400_000_000_000
    order = np.argsort(healthy.time_ns + shift)
    shuffled = StiffnessHistory(
        **{
            name: (column + shift if name == "time_ns" else column)[..., order]
            for name, column in vars(healthy).items()
        }
    )
    before, after = learned(healthy), learned(shuffled)
    for one, other in zip(before.table.cells, after.table.cells, strict=True):
        for name in ("cell", "n_days", "n_readings", "location"):
            assert getattr(one, name) == getattr(other, name)
        assert one.scatter == pytest.approx(other.scatter, rel=0.2)  # other spells are left out
    shift = deviation(after, healthy) - deviation(before, healthy)
    assert np.nanquantile(np.abs(shift), 0.95) < 1e-3  # alike days are weighed as one, and are not


@pytest.mark.long
def test_the_surface_is_as_near_the_truth_as_it_says(film_life):
    errors = []
    for seed in range(6):
        history = film_life(seed)
        baseline = learned(history)
        conditions = history.conditions
        e, oil_c = conditions.eccentricity_ratio, conditions.oil_temperature_c
        truth = np.log(0.5e9) + 4.0 * (e - 0.4) - 0.02 * (oil_c - 45.0)
        found = baseline.compare(conditions, truth, history.u_random[0])
        counted = found.place >= 0
        errors.append(found.deviation[counted] / found.surface_std[counted])
    assert 0.4 < np.std(np.concatenate(errors)) < 1.3


def test_nothing_is_compared_outside_the_learned_support_nor_at_an_unseen_attitude(healthy):
    baseline = learned(healthy)
    far = FilmConditions(np.array([0.95, 0.4, 0.4]), np.array([45.0, 5.0, 45.0]), np.full(3, 30.0))
    found = baseline.compare(far, np.full(3, 20.0), np.full(3, 0.01))
    assert found.place[:2].tolist() == [-1, -1]
    assert found.place[2] >= 0
    assert np.isnan(found.deviation[:2]).all()
    random = np.random.default_rng(4)
    attitude_deg = 30.0 + random.normal(0.0, 3.0, len(healthy))
    baseline = learned(replace(healthy, attitude_deg=attitude_deg))
    turned = replace(healthy, attitude_deg=attitude_deg + 90.0).conditions
    found = baseline.compare(turned, healthy.ln_k[0], healthy.u_random[0])
    assert np.mean(found.place >= 0) < 0.01


def test_a_reading_that_scatters_more_than_the_learned_ones_weighs_less(healthy):
    baseline = learned(healthy)
    here = FilmConditions(np.full(2, 0.4), np.full(2, 45.0), np.full(2, 30.0))
    typical, noisy = baseline.u_random, 10.0 * baseline.scatter
    weight = baseline.compare(here, np.full(2, 20.0), np.array([typical, noisy])).weight
    assert weight[1] < 0.02 < 0.2 < weight[0] <= 1.0


def test_a_cell_needs_readings_on_several_days_or_neighbours_to_borrow_from(healthy):
    settings = BaselineSettings(min_days=5, min_readings=30)
    cells = {cell.cell: cell for cell in learned(healthy, settings).table.cells}
    own = frozenset(name for name, cell in cells.items() if cell.support is Support.OWN)
    assert all(cells[name].n_days >= 5 and cells[name].n_readings >= 30 for name in own)
    for name, cell in cells.items():
        if cell.support is Support.BORROWED:
            around = sum(cells[other].n_days for other in neighbourhood(name) if other in cells)
            assert name in cells_between(own, settings.borrowing_reach) or around >= 5
    own = frozenset({(1, 5), (4, 5), (4, 9)})
    assert cells_between(own, reach=2) == {(2, 5), (3, 5)}
    assert cells_between(own, reach=3) == {(2, 5), (3, 5), (4, 6), (4, 7), (4, 8)}


def test_less_is_known_of_the_far_side_of_the_outermost_cell(healthy):
    baseline = learned(healthy)
    known = [cell for cell in baseline.table.cells if cell.support is Support.OWN]
    edge = max(known, key=lambda cell: cell.cell[0])
    e = 0.05 * edge.cell[0] + np.array([0.001, 0.025, 0.049])
    there = FilmConditions(e, np.full(3, edge.oil_temperature_c), np.full(3, edge.attitude_deg))
    std = baseline.compare(there, np.full(3, 20.0), np.full(3, 0.01)).surface_std
    assert 0.0 < std[0] < std[1] < std[2]


def test_what_position_does_lasts_and_the_rest_averages_out(film_life):
    history = film_life(5, days=240)
    e, day = history.eccentricity_ratio, history.time_ns // 86_400_000_000_000
    steep = np.exp(9.0 * (e - 0.4))
    drift = 0.004 * np.random.default_rng(8).standard_normal(400)[(day - day[0]) // 8]
    moved = with_ln_k(history, history.ln_k + 1.2 * steep + 9.0 * 1.2 * steep * drift)
    cells = [c for c in learned(moved).table.cells if c.support is Support.OWN]
    lasting = {c.cell[0]: c.lasting / c.scatter for c in cells}
    assert lasting[min(lasting)] < 0.6 < lasting[max(lasting)]


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_wrong_readings_hardly_move_a_baseline(healthy, share):
    random = np.random.default_rng(7)
    is_wrong = random.random(healthy.ln_k.shape) < share
    wrong = healthy.ln_k + np.where(is_wrong, random.uniform(0.5, 3.0, is_wrong.shape), 0.0)
    clean, spoiled = learned(healthy), learned(with_ln_k(healthy, wrong))
    both = deviation(clean, healthy) - deviation(spoiled, healthy)
    assert np.nanquantile(np.abs(both), 0.95) < 0.02
    assert np.nanmedian(both) < 0.01


def test_a_fault_or_a_few_days_or_what_had_not_settled_is_not_learned(film_life, healthy):
    def fall(hours: np.ndarray) -> np.ndarray:
        return np.where(hours > 90 * 24, np.log(0.8), 0.0)

    clean, spoiled = learned(film_life(2)), learned(film_life(2, change=fall))
    shift = deviation(spoiled, film_life(2)) - deviation(clean, film_life(2))
    assert np.nanmedian(np.abs(shift)) < 0.01
    assert spoiled.rejected_share > 0.15

    assert baseline_of(film_life(1, days=15)).quantities == ()
    unsettled = np.zeros(len(healthy), np.bool_)
    assert learn(healthy, unsettled, ORIGIN, BaselineSettings()).quantities == ()


def test_alike_readings_are_known_to_stray_further(film_life):
    alone = learned(film_life(3, lasting_std=1e-6, noise_std=0.01))
    alike = learned(film_life(3, lasting_std=0.01, noise_std=1e-6))
    assert alike.scatter == pytest.approx(alone.scatter, rel=0.5)
    assert alike.time_scatter[1].share > 2.0 * alone.time_scatter[1].share


def test_an_attitude_that_matters_is_learned(healthy):
    day = healthy.time_ns // 86_400_000_000_000 - healthy.time_ns[0] // 86_400_000_000_000
    attitude_deg = np.random.default_rng(5).uniform(-180.0, 180.0, 121)[day]
    turned = replace(
        healthy,
        attitude_deg=attitude_deg,
        ln_k=healthy.ln_k + 0.4 * healthy.eccentricity_ratio * np.cos(np.radians(attitude_deg)),
    )
    blind, seeing = (learned(turned, BaselineSettings(uses_attitude=yes)) for yes in (False, True))
    assert seeing.scatter < 0.5 * blind.scatter
    assert seeing.scatter == pytest.approx(learned(healthy).scatter, rel=0.2)
    sectors = learned(turned, BaselineSettings(CellGrid(attitude_width_deg=90.0)))
    assert {len(cell.cell) for cell in sectors.table.cells} == {3}


def test_both_directions_of_a_bearing_are_learned(healthy):
    assert [each.direction for each in baseline_of(healthy).quantities] == ["x", "y"]


def history(n: int = 5) -> StiffnessHistory:
    one, pair = np.ones(n), np.ones((2, n))
    return StiffnessHistory(
        *(np.arange(n), one, one, one, one, one, one),
        *(20.0 * pair, 0.01 * pair, 50.0 * pair, 20.0 * pair),
    )


def test_columns_of_unequal_length_are_refused():
    with pytest.raises(ValueError, match=r"power_mw: shape \(4,\), expected \(5,\)"):
        replace(history(), power_mw=np.ones(4))


def test_a_part_of_a_history_is_a_history_and_a_missing_number_says_why():
    whole = history()
    assert whole.rows(1, 3).time_ns.tolist() == [1, 2]
    assert len(whole.rows(2, 2)) == 0
    ln_k = history().ln_k.copy()
    ln_k[1, 2] = np.nan
    columns = {**vars(whole), "ln_k": ln_k}
    del columns["outcome"]
    assert StiffnessHistory(**columns).outcome[1].tolist() == [
        0,
        0,
        ReadingOutcome.BAD_QUALITY,
        0,
        0,
    ]


@pytest.mark.parametrize(
    ("column", "row", "value", "says"),
    [
        ("time_ns", 2, 1, "time_ns: row 2 must be later than row 1"),
        ("oil_temperature_c", 3, np.inf, "oil_temperature_c: row 3 is infinite"),
        ("ln_k", (0, 4), np.nan, "outcome: row 4 contradicts ln_k"),
        ("outcome", (0, 4), ReadingOutcome.BAD_QUALITY, "outcome: row 4 contradicts ln_k"),
        ("u_random", (1, 0), 0.0, "u_random: row 0 must be above 0"),
    ],
)
def test_impossible_columns_are_refused_with_their_row(column, row, value, says):
    wrong = getattr(history(), column).copy()
    wrong[row] = value
    with pytest.raises(ValueError, match=says):
        replace(history(), **{column: wrong})


def test_what_cells_are_like_and_a_few_wrong_days_are_no_drift():
    random = np.random.default_rng(1)
    day = np.repeat(np.arange(100), 5)
    cell = np.clip(day // 10 + random.integers(-2, 3, day.size), 0, 9)  # a season through the cells
    value = 0.5 * cell + random.normal(0.0, 0.01, day.size)
    found = drift_within(day, value, cell)
    assert found is not None
    assert abs(found.change) < 3.0 * found.std < 0.02
    random = np.random.default_rng(3)
    day = np.repeat(np.arange(100), 4)
    value = random.normal(0.0, 0.01, day.size)
    value[-4:] = -0.8
    found = drift_within(day, value, np.zeros(day.size, np.int64))
    assert found is not None
    assert abs(found.change) < 0.02
    day = np.arange(100)
    assert drift_within(day, -0.01 * day, day) is None


def test_drift_is_found_and_its_uncertainty_covers_it():
    random = np.random.default_rng(2)
    day = np.repeat(np.arange(120), 4)
    errors = []
    for _ in range(200):
        cell = random.integers(0, 20, day.size)
        alike = np.repeat(random.normal(0.0, 0.01, 15), 8)[day]  # spells that are alike
        value = 0.3 * cell - 0.05 * day / 119 + alike + random.normal(0.0, 0.01, day.size)
        found = drift_within(day, value, cell)
        assert found is not None
        errors.append((found.change + 0.05) / found.std)
    assert np.mean(np.abs(errors) < 2.0) > 0.85
    assert abs(np.mean(errors)) < 0.3


@pytest.mark.parametrize("size", [0.0, 0.1])
def test_a_baseline_tells_whether_its_film_changed_while_it_was_learned(film_life, size):
    history = film_life(
        4, change=lambda hours: np.log(1.0 - size * np.clip(hours / 24 / 110, 0.0, 1.0))
    )
    settled = np.ones(len(history), np.bool_)
    origin = Origin("U1", "UJB", "dynamic", 1, "Ada", 0)
    learned = learn(history, settled, origin, BaselineSettings())
    drifts = [learning_drift(history, settled, quantity) for quantity in learned.quantities]
    for found in drifts:
        assert isinstance(found, Drift)
        assert abs(found.change - np.log(1.0 - size)) < max(4.0 * found.std, 0.03)
        assert (abs(found.change) > 3.0 * found.std) == (size > 0.0)


N = 4000


def test_scatter_is_put_down_to_position_if_slopes_differ_and_not_to_a_few_wrong_days():
    random = np.random.default_rng(1)
    slope = random.uniform(0.0, 6.0, N)
    deviation = 0.006 * random.standard_normal(N) + 0.003 * slope * random.standard_normal(N)
    found = slope_scatter(slope, deviation)
    steep = np.array([5.0])
    assert np.sqrt(found.variance(steep)) == pytest.approx(np.hypot(0.006, 0.015), rel=0.1)
    assert np.sqrt(found.lasting(steep)) == pytest.approx(0.015, rel=0.15)
    assert found.lasting(np.array([0.0])) == 0.0
    random = np.random.default_rng(2)
    found = slope_scatter(np.full(N, 4.0), 0.01 * random.standard_normal(N))
    assert found.lasting(np.array([4.0])) == 0.0
    assert np.sqrt(found.variance(np.array([4.0]))) == pytest.approx(0.01, rel=0.1)
    random = np.random.default_rng(3)
    slope = random.uniform(0.0, 6.0, N)
    deviation = 0.01 * random.standard_normal(N)
    deviation[:40] = 1.0
    found = slope_scatter(slope, deviation)
    assert np.sqrt(found.variance(np.array([3.0]))) == pytest.approx(0.01, rel=0.15)
