"""Baselines and their steps in the words of the API."""

from dataclasses import asdict

import numpy as np

from core.baseline.baseline import BearingBaseline, QuantityBaseline
from core.baseline.cell_table import CellStatistics
from core.condition.cells import CellGrid
from core.machine.unit import Estimator
from service.api.baseline_models import (
    BaselineCellsModel,
    BaselineDirectionModel,
    BaselineModel,
    BaselineStatusName,
    BaselineStepModel,
    BaselineVersionModel,
    LearningModel,
    ReadingCountsModel,
    TimeScatterModel,
)
from service.api.film_conditions import bounds
from service.api.models import EstimatorName
from service.live.learning_progress import RECENT_DAYS, LearningProgress
from service.runtime.times import rfc3339
from service.store.baselines import Versions
from service.store.film_port import BaselineEntry, BaselineStep, StoredStep


def version_model(
    entry: BaselineEntry, versions: Versions, steps: list[StoredStep]
) -> BaselineVersionModel:
    """A baseline as it stands after all that was done."""
    own = [step for step in steps if step.version == entry.version]
    return BaselineVersionModel(
        version=entry.version,
        estimator=entry.estimator.value,
        status=_status(entry, versions, own),
        author=entry.author,
        created=rfc3339(entry.created_ns),
        learned_from=rfc3339(entry.learned_from_ns),
        learned_until=rfc3339(entry.learned_until_ns),
        event=entry.event,
        remark=_remark(entry, own),
        is_frozen=versions.is_frozen and entry.version == versions.in_force,
    )


def _status(entry: BaselineEntry, versions: Versions, own: list[StoredStep]) -> BaselineStatusName:
    if entry.version == versions.in_force:
        return "in_force"
    if entry.version in versions.rejected:
        return "rejected"
    was_accepted = any(step.step is BaselineStep.ACCEPTED for step in own)
    is_before = versions.renewed_ns is not None and entry.learned_from_ns < versions.renewed_ns
    return "superseded" if was_accepted or is_before else "learned"


def _remark(entry: BaselineEntry, own: list[StoredStep]) -> str:
    """What its learning step says beyond the event."""
    told = [step.reason for step in own if step.step is BaselineStep.LEARNED]
    return next((words for words in told if words != entry.event), "")


def step_model(step: StoredStep) -> BaselineStepModel:
    """One step."""
    return BaselineStepModel(
        step=step.step.value,
        version=step.version,
        time=rfc3339(step.time_ns),
        actor=step.actor,
        reason=step.reason,
        event_time=None if step.from_ns is None else rfc3339(step.from_ns),
    )


def learning_model(progress: LearningProgress, n_days_wanted: int) -> LearningModel:
    """How far learning has come."""
    since_ns, until_ns = progress.since_ns, progress.until_ns
    return LearningModel(
        since=None if since_ns is None else rfc3339(since_ns),
        until=None if until_ns is None else rfc3339(until_ns),
        is_over=progress.is_over,
        n_readings=progress.n_readings,
        n_days=progress.n_days,
        n_days_wanted=n_days_wanted,
        recent=ReadingCountsModel(days=RECENT_DAYS, **asdict(progress.recent)),
    )


def baseline_model(baseline: BearingBaseline, about: BaselineVersionModel) -> BaselineModel:
    """One baseline with its cells."""
    x, y = (baseline.of(direction) for direction in ("x", "y"))
    grid = next((found.grid for found in (x, y) if found), None)
    return BaselineModel(
        unit=baseline.origin.unit,
        bearing=baseline.origin.bearing,
        about=about,
        eccentricity_width=grid.eccentricity_width if grid else None,
        oil_temperature_width_c=grid.temperature_width_c if grid else None,
        x=_direction(x) if x else None,
        y=_direction(y) if y else None,
    )


def _direction(learned: QuantityBaseline) -> BaselineDirectionModel:
    return BaselineDirectionModel(
        cells=_cells(list(learned.table.cells), learned.grid),
        scatter_percent=100.0 * learned.scatter,
        u_random_percent=100.0 * learned.u_random,
        rejected_share=learned.rejected_share,
        time_scatter=[
            TimeScatterModel(time_scale_h=time.time_scale_h, share=time.share)
            for time in learned.time_scatter
        ],
    )


def _cells(cells: list[CellStatistics], grid: CellGrid) -> BaselineCellsModel:
    low_e, high_e = _bounds(cells, 0, grid.eccentricity_width)
    low_c, high_c = _bounds(cells, 1, grid.temperature_width_c)
    attitude = (
        None if grid.attitude_width_deg is None else _bounds(cells, 2, grid.attitude_width_deg)
    )
    return BaselineCellsModel(
        eccentricity_low=low_e,
        eccentricity_high=high_e,
        oil_temperature_low_c=low_c,
        oil_temperature_high_c=high_c,
        attitude_low_deg=attitude[0] if attitude else None,
        attitude_high_deg=attitude[1] if attitude else None,
        eccentricity_ratio=[cell.eccentricity_ratio for cell in cells],
        oil_temperature_c=[cell.oil_temperature_c for cell in cells],
        n_readings=[cell.n_readings for cell in cells],
        n_days=[cell.n_days for cell in cells],
        stiffness_n_per_m=np.exp([cell.location for cell in cells]).tolist(),
        scatter_percent=[100.0 * cell.scatter for cell in cells],
        surface_std_percent=[100.0 * cell.surface_std for cell in cells],
        support=[cell.support.value for cell in cells],
    )


def _bounds(
    cells: list[CellStatistics], axis: int, width: float
) -> tuple[list[float], list[float]]:
    found = [bounds(cell.cell[axis], width) for cell in cells]
    return [low for low, _ in found], [high for _, high in found]


def estimator_name(estimator: Estimator | None) -> EstimatorName | None:
    """An estimator in the word of the API."""
    return None if estimator is None else estimator.value
