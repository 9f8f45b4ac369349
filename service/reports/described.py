"""A bearing's results in the words of the document."""

import math
from collections.abc import Iterator

from core.change.cause import Attribution
from core.change.film_judge import FilmFinding, FilmNews
from core.change.settings import FilmRules
from core.condition.cells import BearingCondition, Cell, CellGrid
from core.machine.unit import Estimator
from core.monitor.assessment import Assessment, AveragingWindow
from core.monitor.catalogue import BY_NAME
from core.quality import Level, Reading
from core.stiffness.estimators import ESTIMATORS
from core.uncertainty import Budget
from service.api.routes.alarm_models import LEVEL_NAMES
from service.reports.parts import (
    AXES,
    BearingPart,
    BudgetLinePart,
    CausePart,
    ConditionPart,
    Direction,
    EstimatorPart,
    FilmReadingPart,
    FindingPart,
    QualityWord,
    ReadingPart,
    WindowPart,
    finite,
)
from service.runtime.times import rfc3339

LEVEL_WORDS: dict[Level, QualityWord] = {
    Level.GOOD: "good",
    Level.UNCERTAIN: "uncertain",
    Level.BAD: "bad",
}


def bearing_part(found: Assessment, film: FilmNews | None, rules: FilmRules | None) -> BearingPart:
    """One bearing."""
    watched = None if rules is None else rules.estimators.get(found.bearing)
    return BearingPart(
        bearing=found.bearing,
        time=rfc3339(found.time_ns),
        window=_window(found.window),
        evidence=found.evidence.value,
        speed_source=found.speed_source.value,
        condition=_condition(found.condition, rules),
        readings={name: reading_part(name, each) for name, each in found.readings.items()},
        estimators=list(_estimators(found, watched)),
        budgets={name: _budget(budget) for name, budget in found.budgets.items()},
        film=None if film is None else _film(film),
    )


def reading_part(name: str, reading: Reading) -> ReadingPart:
    """One reading of the catalogue."""
    return ReadingPart(
        value=finite(reading.value),
        unit=BY_NAME[name].unit,
        level=LEVEL_WORDS[reading.quality.level],
        reason=reading.quality.reason.value,
        u_random=finite(reading.u_random),
        u_systematic=finite(reading.u_systematic),
        interval_95=_finite_pair(reading.interval_95),
    )


def cell_bounds(cell: Cell | None, grid: CellGrid | None) -> list[tuple[float, float]] | None:
    """Limits of a cell along each axis."""
    if cell is None or grid is None:
        return None
    widths = (grid.eccentricity_width, grid.temperature_width_c, grid.attitude_width_deg)
    pairs = zip(cell, (width for width in widths if width is not None), strict=True)
    return [(bin_ * width, (bin_ + 1) * width) for bin_, width in pairs]


def _estimators(found: Assessment, watched: Estimator | None) -> Iterator[EstimatorPart]:
    for estimator, entry in ESTIMATORS.items():
        for direction in AXES:
            name = entry.stiffness.format(axes=direction * 2)
            coherence = found.readings[entry.coherence.format(axis=direction)]
            yield EstimatorPart(
                estimator=estimator.value,
                direction=direction,
                stiffness=reading_part(name, found.readings[name]),
                coherence=finite(coherence.value),
                is_preferred=found.estimators.get(direction * 2) is estimator,
                is_watched=estimator is watched,
            )


def _window(window: AveragingWindow) -> WindowPart:
    return WindowPart(
        epoch=window.epoch,
        first_index=window.first_index,
        stop_index=window.stop_index,
        n_segments=window.n_segments,
        n_segments_wanted=window.n_segments_wanted,
        coverage=window.coverage,
        duration_s=window.duration_s,
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
        BudgetLinePart(
            name=line.name,
            kind=line.kind.value,
            distribution=line.distribution.value,
            width=line.width,
            sensitivity=line.sensitivity,
            contribution=line.contribution,
        )
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
        findings=[_finding(*each) for each in zip(AXES, news.findings, strict=True)],
    )


def _finding(direction: Direction, found: FilmFinding) -> FindingPart:
    return FindingPart(
        direction=direction,
        verdict=found.verdict.name.lower(),
        level=None if found.level is None else LEVEL_NAMES[found.level],
        change=finite(found.change),
        change_std=finite(found.change_std),
        time_scale_h=found.time_scale_h,
        deviation=finite(found.deviation),
        deviation_std=finite(found.deviation_std),
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
