"""What a film was compared with, in the words of the document."""

import math
from collections.abc import Iterator

import numpy as np

from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.cell_table import CellStatistics
from core.change.decision import Decision
from core.change.film_judge import FilmNews
from core.change.settings import FilmRules
from core.condition.cells import Cell, FilmConditions
from service.reports.described import cell_bounds
from service.reports.members import Members
from service.reports.parts import (
    AXES,
    BaselinePart,
    CellPart,
    ComparisonPart,
    Direction,
    ExpectedPart,
    TimeScalePart,
    finite,
    rounded,
)
from service.runtime.times import rfc3339

N_EXPECTED = 60
"""Points of the line that shows what is expected."""


def comparisons(
    news: FilmNews, baseline: BearingBaseline | None, rules: FilmRules, members: Members | None
) -> list[ComparisonPart]:
    """Both directions of a bearing's film.

    Parameters
    ----------
    members
        Readings of the cell that the baseline stands on; None if they could not be read.
    """
    return [_comparison(news, axis, baseline, rules, members) for axis in AXES]


def cell_of(news: FilmNews, rules: FilmRules) -> Cell | None:
    """The cell of a reading; None where its condition is not known."""
    here = news.reading.conditions
    if not rules.grid.is_known(here)[0]:
        return None
    return tuple(rules.grid.cells(here)[:, 0].tolist())


def _comparison(
    news: FilmNews,
    direction: Direction,
    baseline: BearingBaseline | None,
    rules: FilmRules,
    members: Members | None,
) -> ComparisonPart:
    reading, row = news.reading, AXES.index(direction)
    value, cell = reading.values[row], cell_of(news, rules)
    learned = baseline.of(direction) if baseline else None
    own = None if learned is None or cell is None else _own_cell(learned, cell)
    found = _expected(learned, news.reading.conditions) if learned and own else None
    return ComparisonPart(
        bearing=reading.bearing,
        direction=direction,
        estimator=reading.estimator.value,
        time=rfc3339(reading.time_ns),
        stiffness_n_per_m=rounded(math.exp(value.ln_k)),
        u_random=rounded(value.u_random),
        eccentricity_ratio=finite(reading.eccentricity_ratio),
        oil_temperature_c=finite(reading.oil_temperature_c),
        attitude_deg=finite(reading.attitude_deg),
        expected_n_per_m=None if found is None else rounded(float(found[0])),
        baseline=_baseline(baseline, learned) if baseline and learned else None,
        cell=None if own is None else _cell(own),
        bounds=cell_bounds(cell, rules.grid),
        time_scales=list(_time_scales(news.decisions[row], learned, rules)) if learned else [],
        members=None if members is None or cell is None else members.part(direction),
        expected=None if learned is None else _line(learned, news),
        map=[] if learned is None else [_cell(each) for each in learned.table.cells],
    )


def _own_cell(learned: QuantityBaseline, cell: Cell) -> CellStatistics | None:
    return next((each for each in learned.table.cells if each.cell == cell), None)


def _expected(learned: QuantityBaseline, conditions: FilmConditions) -> list[float]:
    """Expected stiffness at each condition; not a number where nothing is known."""
    place = learned.table.find(learned.grid.cells(conditions))
    known = learned.is_known(conditions) & (place >= 0)
    nothing = np.full(len(conditions), np.nan)
    if known.any():
        nothing[known] = np.exp(learned.surface.at(conditions.rows(np.flatnonzero(known))))
    return [float(each) for each in nothing]


def _line(learned: QuantityBaseline, news: FilmNews) -> ExpectedPart | None:
    """What is expected over all eccentricities at the oil temperature of the reading."""
    seen = [cell.cell[0] for cell in learned.table.cells]
    here, width = news.reading, learned.grid.eccentricity_width
    if not seen or not math.isfinite(here.oil_temperature_c):
        return None
    e = np.linspace(min(seen) * width, (max(seen) + 1) * width, N_EXPECTED, endpoint=False)
    one = np.ones(e.size)
    along = FilmConditions(e, here.oil_temperature_c * one, here.attitude_deg * one)
    return ExpectedPart(
        eccentricity_ratio=[rounded(each) for each in e.tolist()],
        stiffness_n_per_m=[rounded(each) for each in _expected(learned, along)],
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


def _cell(found: CellStatistics) -> CellPart:
    return CellPart(
        cell=list(found.cell),
        n_readings=found.n_readings,
        n_days=found.n_days,
        location_n_per_m=float(f"{math.exp(found.location):.7g}"),
        scatter=found.scatter,
        surface_std=found.surface_std,
        support=found.support.value,
    )


def _time_scales(
    decision: Decision, learned: QuantityBaseline, rules: FilmRules
) -> Iterator[TimeScalePart]:
    if len(decision.evidence.scales) != len(learned.time_scatter):
        return  # nothing has been gathered with this baseline
    for found in decision.evidence.findings(learned):
        yield TimeScalePart(
            time_scale_h=found.time_scale_h,
            change=found.change,
            std=found.std,
            sure_from=rules.change.significance_threshold(found.time_scale_h),
        )
