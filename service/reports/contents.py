"""Content of an evidence document: results of bearings, and comparisons with baselines."""

import math
from collections.abc import Iterator

import numpy as np

from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.cell_table import CellStatistics
from core.baseline.history import QUANTITIES, StiffnessHistory, are_ratios
from core.change.cause import Attribution
from core.change.decision import Decision
from core.change.film_judge import FilmFinding, FilmNews
from core.change.settings import FilmRules, percent_of
from core.condition.cells import BearingCondition, Cell, CellGrid, FilmConditions
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment
from core.monitor.catalogue import quantity_of
from core.quality import Level, Reading
from core.stiffness.bracket_ratio import reported_name
from core.stiffness.estimators import ESTIMATORS
from core.uncertainty import Budget
from core.units import NS_PER_S
from service.reports.parts import (
    AXES,
    BaselinePart,
    BearingPart,
    BudgetLinePart,
    CausePart,
    CellPart,
    ComparisonPart,
    ConditionPart,
    Direction,
    EstimatorPart,
    ExpectedPart,
    FilmReadingPart,
    FindingPart,
    MembersPart,
    QualityWord,
    ReadingPart,
    TimeScalePart,
    WindowPart,
    finite,
    rounded,
)
from service.runtime.times import rfc3339
from service.settings.alarm_kinds import LEVEL_NAMES
from service.store.film_readings import FilmQuery
from service.store.films import FilmStore
from service.store.port import ValueRange

LEVEL_WORDS: dict[Level, QualityWord] = {
    Level.GOOD: "good",
    Level.UNCERTAIN: "uncertain",
    Level.BAD: "bad",
}


def bearing_part(found: Assessment, film: FilmNews | None, rules: FilmRules | None) -> BearingPart:
    """Return the part about one bearing; `film` and `rules` are None if its film is not judged."""
    watched = None if rules is None else rules.estimators.get(found.bearing)
    return BearingPart(
        bearing=found.bearing,
        time=rfc3339(found.time_ns),
        window=WindowPart.model_validate(found.window, from_attributes=True),
        evidence=found.evidence.value,
        speed_source=found.speed_source.value,
        condition=_condition(found.condition, rules),
        readings={name: reading_part(name, each) for name, each in found.readings.items()},
        estimators=list(_estimators(found, watched)),
        budgets={name: _budget(budget) for name, budget in found.budgets.items()},
        film=None if film is None else _film(film),
    )


def reading_part(name: str, reading: Reading) -> ReadingPart:
    """Return the part about the reading of the quantity ``name`` of the catalogue.

    Numbers that are not finite become None.
    """
    return ReadingPart(
        value=finite(reading.value),
        unit=quantity_of(name).unit,
        level=LEVEL_WORDS[reading.quality.level],
        reason=reading.quality.reason.value,
        u_random=finite(reading.u_random),
        u_systematic=finite(reading.u_systematic),
        interval_95=_finite_pair(reading.interval_95),
    )


def cell_bounds(cell: Cell | None, grid: CellGrid | None) -> list[tuple[float, float]] | None:
    """Return the limits (low, high) of a cell along each axis of its grid; None without them.

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
            yield EstimatorPart(
                estimator=estimator.value,
                direction=direction,
                stiffness=reading_part(name, found.readings[name]),
                coherence=finite(coherence.value),
                is_preferred=found.estimators.get(direction * 2) is estimator,
                is_watched=estimator is watched,
            )


def _condition(found: BearingCondition | None, rules: FilmRules | None) -> ConditionPart | None:
    if found is None:
        return None
    return ConditionPart(
        state=found.state.name.lower(),
        is_settled=found.is_settled,
        cell=None if found.cell is None else list(found.cell),
        bounds=cell_bounds(found.cell, rules.grid if rules else None),
    )


def _budget(budget: Budget) -> list[BudgetLinePart]:
    lines = (
        BudgetLinePart.model_validate(line, from_attributes=True)
        for line in budget.lines
        if math.isfinite(line.contribution) and math.isfinite(line.width)
    )
    return sorted(lines, key=lambda line: -line.contribution)


def _finite_pair(pair: tuple[float, float] | None) -> tuple[float, float] | None:
    return pair if pair is not None and all(map(math.isfinite, pair)) else None


def _film(news: FilmNews) -> FilmReadingPart:
    reading = news.reading
    return FilmReadingPart(
        time=rfc3339(reading.time_ns),
        estimator=reading.estimator.value,
        state=reading.condition.state.name.lower(),
        is_settled=reading.condition.is_settled,
        findings=[_finding(each) for each in news.findings],
    )


def _finding(found: FilmFinding) -> FindingPart:
    quantity = QUANTITIES[found.quantity]
    return FindingPart(
        direction="x" if quantity.row == 0 else "y",
        is_damping=quantity.value != "ln_k",
        verdict=found.verdict.name.lower(),
        level=None if found.level is None else LEVEL_NAMES[found.level],
        change_percent=None if found.change is None else percent_of(found.change),
        time_scale_h=found.time_scale_h,
        deviation_percent=None if found.deviation is None else percent_of(found.deviation),
        deviation_95_percent=_finite_pair(found.deviation_95_percent),
        baseline_version=found.baseline_version,
        attribution=None if found.attribution is None else _cause(found.attribution),
    )


def _cause(found: Attribution) -> CausePart:
    return CausePart(
        cause=found.cause.value,
        reason=found.reason,
        film_share=finite(found.film_share),
        film_share_std=finite(found.film_share_std),
        shaft_change=finite(found.shaft_change),
        bearing_change=finite(found.bearing_change),
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
    """Return the settled readings of a cell in the learning period, except those with an alarm.

    Raises
    ------
    StoreError
        If the store cannot be read.
    """
    origin = baseline.origin
    eccentricity, oil_c, *_ = cell_bounds(cell, rules.grid) or [(0.0, 0.0)] * 2
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
    """Return the cell of a film reading; None if its operating condition is unknown."""
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
        Baseline of the bearing; None leaves what is expected empty.
    members
        Readings of the cell; None if the store is unreadable or the cell is unknown.
    """
    reading, row = news.reading, AXES.index(direction)
    value, cell = reading.values[row], cell_of(news, rules)
    learned = baseline.of(f"k_{direction}") if baseline else None
    cells = learned.table.cells if learned else ()
    own = next((each for each in cells if each.cell == cell), None)
    found = _expected_at(learned, news.reading.conditions) if learned and own else None
    return ComparisonPart(
        bearing=reading.bearing,
        direction=direction,
        estimator=reading.estimator.value,
        time=rfc3339(reading.time_ns),
        stiffness=rounded(math.exp(value.ln_k)),
        stiffness_unit="k_b" if are_ratios(value.ln_k) else "N/m",
        u_random=rounded(value.u_random),
        eccentricity_ratio=finite(reading.eccentricity_ratio),
        oil_temperature_c=finite(reading.oil_temperature_c),
        attitude_deg=finite(reading.attitude_deg),
        expected_stiffness=None if found is None else rounded(float(found[0])),
        baseline=_baseline(baseline, learned) if baseline and learned else None,
        cell=None if own is None else _cell_part(own),
        bounds=cell_bounds(cell, rules.grid),
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


def _baseline(found: BearingBaseline, learned: QuantityBaseline) -> BaselinePart:
    origin = found.origin
    return BaselinePart(
        version=origin.version,
        author=origin.author,
        created=rfc3339(origin.created_ns),
        event=origin.event,
        learned_from=rfc3339(found.learned_from_ns),
        learned_until=rfc3339(found.learned_until_ns),
        scatter=learned.scatter,
    )


def _cell_part(found: CellStatistics) -> CellPart:
    return CellPart(
        cell=list(found.cell),
        n_readings=found.n_readings,
        n_days=found.n_days,
        location=float(f"{math.exp(found.location):.7g}"),
        scatter=found.scatter,
        surface_std=found.surface_std,
        support=found.support.value,
    )


def _time_scales(
    decision: Decision, learned: QuantityBaseline, rules: FilmRules
) -> Iterator[TimeScalePart]:
    if len(decision.evidence.scales) != len(learned.time_scatter):
        return  # the averages belong to a baseline with other time scales
    for found in decision.evidence.findings(learned):
        yield TimeScalePart(
            time_scale_h=found.time_scale_h,
            change=found.change,
            std=found.std,
            sure_from=rules.change.significance_threshold(found.time_scale_h),
        )
