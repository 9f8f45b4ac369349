"""Content of an evidence document: results of bearings, and comparisons with baselines."""

import math
from collections.abc import Iterator

import numpy as np

from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.cell_table import CellStatistics
from core.baseline.history import QUANTITIES, StiffnessHistory, are_ratios
from core.change.decision import Decision
from core.change.film_judge import FilmFinding, FilmNews
from core.change.settings import FilmRules, percent_of
from core.condition.cells import BearingCondition, Cell, CellGrid, FilmConditions
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.monitor.catalogue import quantity_of
from core.quality import Reading
from core.stiffness.estimators import ESTIMATORS, reported_name
from core.uncertainty import Budget, BudgetLine
from core.units import NS_PER_S
from service.reports.parts import (
    AXES,
    BaselinePart,
    BearingPart,
    CellPart,
    ComparisonPart,
    ConditionPart,
    Direction,
    EstimatorPart,
    ExpectedPart,
    FilmReadingPart,
    FindingPart,
    MembersPart,
    ReadingPart,
    TimeScalePart,
    rounded,
)
from service.store.film_readings import FilmQuery
from service.store.films import FilmStore
from service.store.port import ValueRange


def bearing_part(found: Assessment, film: FilmNews | None, rules: FilmRules | None) -> BearingPart:
    """Return the part of the evidence document about one bearing.

    `film` and `rules` are None if the film of the bearing is not monitored.
    """
    watched = None if rules is None else rules.estimators.get(found.bearing)
    return BearingPart.of(
        found,
        condition=found.condition and _condition(found.condition, rules),
        readings={name: _reading_part(name, each) for name, each in found.readings.items()},
        estimators=list(_estimators(found, watched)),
        budgets={name: _lines(budget) for name, budget in found.budgets.items()},
        film=film and _film(film),
    )


def _reading_part(name: str, reading: Reading) -> ReadingPart:
    """Return the part of the evidence document about a reading of the quantity ``name``."""
    interval = _finite_pair(reading.interval_95)
    return ReadingPart.of(reading, reading.quality, quantity_of(name), interval_95=interval)


def _cell_bounds(cell: Cell | None, grid: CellGrid | None) -> list[tuple[float, float]] | None:
    """Return the limits (low, high) of a cell along each axis of its grid; None without either.

    The axes are eccentricity ratio, oil temperature in °C and, if used, attitude in degrees.
    """
    if cell is None or grid is None:
        return None
    widths = (grid.eccentricity_width, grid.temperature_width_c, grid.attitude_width_deg)
    pairs = zip(cell, (width for width in widths if width is not None), strict=True)
    return [(bin_ * width, (bin_ + 1) * width) for bin_, width in pairs]


def _estimators(found: Assessment, watched: Estimator | None) -> Iterator[EstimatorPart]:
    for estimator, entry in ESTIMATORS.items():
        for direction in AXES:
            name = reported_name(found.readings, entry.stiffness.format(axes=direction * 2))
            coherence = found.readings[entry.coherence.format(axis=direction)]
            yield EstimatorPart.of(
                estimator=estimator,
                direction=direction,
                stiffness=_reading_part(name, found.readings[name]),
                coherence=coherence.value,
                is_preferred=found.estimators.get(direction * 2) is estimator,
                is_watched=estimator is watched,
            )


def _condition(found: BearingCondition, rules: FilmRules | None) -> ConditionPart:
    return ConditionPart.of(found, bounds=_cell_bounds(found.cell, rules.grid if rules else None))


def _lines(budget: Budget) -> list[BudgetLine]:
    """Return the lines of a budget with finite numbers, the largest contribution first."""
    numbers = ((line.contribution, line.width, line) for line in budget.lines)
    lines = (line for *found, line in numbers if all(map(math.isfinite, found)))
    return sorted(lines, key=lambda line: -line.contribution)


def _finite_pair(pair: tuple[float, float] | None) -> tuple[float, float] | None:
    return pair if pair is not None and all(map(math.isfinite, pair)) else None


def _film(news: FilmNews) -> FilmReadingPart:
    findings = [_finding(each) for each in news.findings]
    return FilmReadingPart.of(news.reading.condition, news.reading, findings=findings)


def _finding(found: FilmFinding) -> FindingPart:
    quantity = QUANTITIES[found.quantity]
    return FindingPart.of(
        found,
        direction="x" if quantity.row == 0 else "y",
        is_damping=quantity.value != "ln_k",
        change_percent=None if found.change is None else percent_of(found.change),
        deviation_percent=None if found.deviation is None else percent_of(found.deviation),
        deviation_95_percent=_finite_pair(found.deviation_95_percent),
    )


MAX_MEMBERS = 2000
"""Maximum number of readings listed in a comparison."""


def _members_part(found: StiffnessHistory, direction: Direction) -> MembersPart:
    """Return the readings of one direction, evenly thinned to at most `MAX_MEMBERS`."""
    row = AXES.index(direction)
    measured = np.flatnonzero(np.isfinite(found.ln_k[row]))
    rows = measured[:: max(1, -(-measured.size // MAX_MEMBERS))]
    columns = {
        "stiffness": np.exp(found.ln_k[row, rows]),
        "u_random": found.u_random[row, rows],
        "eccentricity_ratio": found.eccentricity_ratio[rows],
        "oil_temperature_c": found.oil_temperature_c[rows],
    }
    return MembersPart(
        n_in_all=int(measured.size),
        time=(found.time_ns[rows] / NS_PER_S).tolist(),
        **{name: [rounded(each) for each in column.tolist()] for name, column in columns.items()},
    )


def members_of(
    store: FilmStore, cell: Cell, baseline: BearingBaseline, rules: FilmRules
) -> StiffnessHistory:
    """Return a cell's settled readings without an alarm, from the learning period of a baseline.

    A cell is a bin of operating conditions.

    Raises
    ------
    StoreError
        If the store cannot be read.
    """
    origin = baseline.origin
    eccentricity, oil_c, *_ = _cell_bounds(cell, rules.grid) or [(0.0, 0.0)] * 2
    query = FilmQuery(
        origin.unit,
        origin.bearing,
        rules.estimators[origin.bearing],
        baseline.learned_from_ns,
        baseline.learned_until_ns + 1,
        eccentricity_ratio=ValueRange(*eccentricity),
        oil_temperature_c=ValueRange(*oil_c),
    )
    found = store.history(query)
    history = found.history
    conditions = history.conditions
    in_cell = np.ones(len(history), np.bool_)
    if len(history):
        wanted = np.array(cell)[:, np.newaxis]
        in_cell = rules.grid.is_known(conditions)
        in_cell &= np.all(rules.grid.cells(conditions) == wanted, axis=0)
    is_healthy = found.is_settled & ~np.any(found.level > 0, axis=0)
    return history.where(in_cell & is_healthy)


N_EXPECTED = 60
"""Number of points of the curve of expected stiffness."""


def cell_of(news: FilmNews, rules: FilmRules) -> Cell | None:
    """Return the cell of operating conditions to which a film reading belongs.

    None if the operating condition of the reading is unknown.
    """
    here = news.reading.conditions
    if not rules.grid.is_known(here)[0]:
        return None
    return tuple(rules.grid.cells(here)[:, 0].tolist())


def comparison(
    news: FilmNews,
    direction: Direction,
    baseline: BearingBaseline | None,
    rules: FilmRules,
    members: StiffnessHistory | None,
) -> ComparisonPart:
    """Return the comparison of a film in one direction with its baseline.

    Parameters
    ----------
    baseline
        Baseline of the bearing; if None, the expected values are omitted.
    members
        Readings of the cell; None if the store is unreadable or the cell is unknown.
    """
    reading, row = news.reading, AXES.index(direction)
    value, cell = reading.values[row], cell_of(news, rules)
    learned = baseline.of(f"k_{direction}") if baseline else None
    cells = learned.table.cells if learned else ()
    own = next((each for each in cells if each.cell == cell), None)
    found = _expected_at(learned, news.reading.conditions) if learned and own else None
    return ComparisonPart.of(
        reading,
        direction=direction,
        stiffness=rounded(math.exp(value.ln_k)),
        stiffness_unit="k_b" if are_ratios(value.ln_k) else "N/m",
        u_random=rounded(value.u_random),
        expected_stiffness=None if found is None else rounded(float(found[0])),
        baseline=BaselinePart.of(baseline.origin, baseline, learned)
        if baseline and learned
        else None,
        cell=None if own is None else _cell_part(own),
        bounds=_cell_bounds(cell, rules.grid),
        time_scales=list(_time_scales(news.decisions[row], learned, rules)) if learned else [],
        members=None if members is None else _members_part(members, direction),
        expected=None if learned is None else _line(learned, news),
        map=[_cell_part(each) for each in cells],
    )


def _expected_at(learned: QuantityBaseline, conditions: FilmConditions) -> list[float]:
    place = learned.table.find(learned.grid.cells(conditions))
    known = learned.is_known(conditions) & (place >= 0)
    nothing = np.full(len(conditions), np.nan)
    if known.any():
        nothing[known] = np.exp(learned.surface.at(conditions.rows(np.flatnonzero(known))))
    return [float(each) for each in nothing]


def _line(learned: QuantityBaseline, news: FilmNews) -> ExpectedPart | None:
    """Return expected stiffness against eccentricity at the oil temperature of the reading."""
    seen = [cell.cell[0] for cell in learned.table.cells]
    here, width = news.reading, learned.grid.eccentricity_width
    if not seen or not math.isfinite(here.oil_temperature_c):
        return None
    e = np.linspace(min(seen) * width, (max(seen) + 1) * width, N_EXPECTED, endpoint=False)
    one = np.ones(e.size)
    along = FilmConditions(e, here.oil_temperature_c * one, here.attitude_deg * one)
    return ExpectedPart(
        eccentricity_ratio=[rounded(each) for each in e.tolist()],
        stiffness=[rounded(each) for each in _expected_at(learned, along)],
    )


def _cell_part(found: CellStatistics) -> CellPart:
    return CellPart.of(found, location=rounded(math.exp(found.location)))


def _time_scales(
    decision: Decision, learned: QuantityBaseline, rules: FilmRules
) -> Iterator[TimeScalePart]:
    if len(decision.evidence.scales) != len(learned.time_scatter):
        return  # the averages belong to a baseline with other time scales
    for found in decision.evidence.findings(learned):
        sure_from = rules.change.significance_threshold(found.time_scale_h)
        yield TimeScalePart.of(found, sure_from=sure_from)
