"""Budgets add up as the GUM says, and say what each estimator's errors come from."""

import copy
import math

import numpy as np
import pytest

from core.machine.unit import BearingAccuracy, BracketDynamics
from core.spectra.cross_spectrum import BEARING_X, SHAFT_X, average
from core.stiffness.stiffness_budget import ratio_budget, transfer_budgets
from core.uncertainty import Budget, coverage_factor, random_line, systematic_line


def test_random_and_systematic_half_widths_stay_apart_and_combine_by_squares():
    assert systematic_line("gain", 0.05, 100.0).contribution == pytest.approx(5.0 / math.sqrt(3.0))
    assert random_line("statistics", 3.0).contribution == 3.0
    a = systematic_line("a", 4.0 * math.sqrt(3.0), -1.0)
    b = systematic_line("b", 12.0 * math.sqrt(3.0), 1.0)
    budget = Budget(100.0, (random_line("statistics", 3.0), a, b))
    assert budget.random == pytest.approx(3.0)
    assert budget.systematic == pytest.approx(math.hypot(4.0, 12.0))
    assert budget.combined == pytest.approx(13.0)
    assert budget.interval == pytest.approx((100.0 - 1.95996 * 13.0, 100.0 + 1.95996 * 13.0))
    random = Budget(100.0, budget.lines[:1])
    assert random.interval == pytest.approx((100.0 - 1.95996 * 3.0, 100.0 + 1.95996 * 3.0))
    empty = Budget(5.0, (), (4.0, 6.0))
    assert Budget(5.0, ()).interval == (5.0, 5.0)
    assert copy.deepcopy((budget, empty)) == (budget, empty)  # as pickle does


def test_few_degrees_of_freedom_widen_the_interval_as_in_the_gums_table():
    # GUM, table G.2: t_95 of 3, 6 and 20 degrees of freedom
    for freedoms, factor in ((3.0, 3.18), (6.0, 2.45), (20.0, 2.09)):
        found = coverage_factor([random_line("a", 1.0, freedoms)])
        assert found == pytest.approx(factor, abs=0.005)
    # GUM, G.4.1, example: 0.25, 0.57 and 0.82 % of 10, 5 and 15 readings have 19.0 together
    example = [random_line(*row) for row in (("a", 0.25, 9.0), ("b", 0.57, 4.0), ("c", 0.82, 14.0))]
    assert coverage_factor(example) == pytest.approx(2.093, abs=0.003)
    mixed = [random_line("a", 1.0, 6.0), systematic_line("b", 10.0, 1.0)]
    assert coverage_factor(mixed) == pytest.approx(1.96, abs=0.01)


SHAFT_UM_PK = 1.45  # root mean square of 50 phasors of variance 2


@pytest.fixture
def at_line() -> tuple[Budget, Budget]:
    """Budgets of `ratio` and of the stiffness of `transfer`, at a line of coherence 0.97."""
    rng = np.random.default_rng(3)
    phasors = rng.normal(size=(50, 4, 1)) + 1j * rng.normal(size=(50, 4, 1))
    phasors[:, 2:] = 0.4 * phasors[:, :2] + 0.07 * phasors[:, 2:]
    spectrum = average(np.array([1.5]), phasors, np.ones((50, 4), dtype=bool))
    bracket, accuracy = BracketDynamics(1.18e9, 0.45e5), BearingAccuracy()
    at = spectrum, 0, SHAFT_X, BEARING_X, bracket, accuracy
    ratio = ratio_budget(*at, runout_um_pk=0.1)
    transfer = transfer_budgets(*at, runout_um_pk=0.1)
    assert ratio is not None
    assert transfer is not None
    return ratio, transfer[0]


def test_each_estimator_names_what_reaches_it_and_without_motion_has_no_budget(at_line):
    ratio, transfer = ({line.name for line in budget.lines} for budget in at_line)
    common = {"spectral statistics", "gain of shaft probe", "gain of bearing transducer"}
    common |= {"bracket stiffness", "runout", "cross-coupling not known"}
    assert transfer == common | {"bracket mass", "bracket damping", "delay between channels"}
    assert ratio == common | {"incoherent motion", "bracket inertia left out"}
    for budget in at_line:
        lines = {line.name: line.contribution / budget.value for line in budget.lines}
        assert lines["gain of shaft probe"] == pytest.approx(0.05 / math.sqrt(3.0))
        assert lines["gain of bearing transducer"] == pytest.approx(0.05 / math.sqrt(3.0))
        assert lines["runout"] == pytest.approx(0.1 / SHAFT_UM_PK / math.sqrt(3.0), rel=0.03)
        # Slightly more than its share, as the bracket's inertia is taken off.
        assert lines["bracket stiffness"] == pytest.approx(0.1 / math.sqrt(3.0), rel=0.005)
    still = average(
        np.array([1.5]), np.zeros((9, 4, 1), dtype=complex), np.ones((9, 4), dtype=bool)
    )
    nothing = ratio_budget(still, 0, SHAFT_X, BEARING_X, BracketDynamics(1.18e9), BearingAccuracy())
    assert nothing is None
