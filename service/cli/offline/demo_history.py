"""A year before the first start: simulated readings, a baseline learned from them, trends."""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.baseline import BearingBaseline, Origin, QuantityBaseline
from core.baseline.history import DIRECTIONS, StiffnessHistory
from core.baseline.learning import learn
from core.change.backtest import DecisionHistory, OperationHistory, decide_all, operation_history
from core.change.settings import FilmRules
from core.change.shaft_response import learn_response
from core.machine.unit import Estimator
from core.stiffness.estimators import ESTIMATORS
from service.settings.core_values import film_rules_of
from service.settings.films import FilmAlarmSettings
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings
from service.store.film_port import BaselineStep, FilmHistory, FilmStore, StoredStep

AUTHOR = "padwatch demo"
EVENT = "learned from a simulated year"


def without_past(store: FilmStore, plant: PlantFile) -> list[UnitSettings]:
    """Units whose films are watched, and of which the store knows nothing."""
    rules = {unit.id: film_rules_of(unit, plant.films) for unit in plant.unit}
    return [
        unit
        for unit in plant.unit
        if isinstance(its := rules[unit.id], FilmRules) and not _is_known(store, unit, its)
    ]


def fill(
    store: FilmStore,
    plant: PlantFile,
    pasts: Mapping[str, Mapping[str, StiffnessHistory]],
    now_ns: int,
) -> None:
    """Give units without a past the one that is simulated.

    Parameters
    ----------
    pasts
        Readings until now, by unit and bearing; a unit without any is left as it is.
    """
    for unit in without_past(store, plant):
        rules, past = film_rules_of(unit, plant.films), pasts.get(unit.id)
        if past and isinstance(rules, FilmRules):
            _fill_unit(store, unit, rules, plant.films, past, now_ns)


def _is_known(store: FilmStore, unit: UnitSettings, rules: FilmRules) -> bool:
    return any(
        store.first_ns(unit.id, bearing, estimator) is not None
        for bearing, estimator in rules.estimators.items()
    )


def _fill_unit(
    store: FilmStore,
    unit: UnitSettings,
    rules: FilmRules,
    settings: FilmAlarmSettings,
    past: Mapping[str, StiffnessHistory],
    now_ns: int,
) -> None:
    settled = []
    for bearing, estimator in rules.estimators.items():
        history = past[bearing]
        operation = operation_history(
            *(history.time_ns, history.speed_rpm, history.power_mw, rules.operating),
            history.oil_temperature_c,
        )
        settled.append(operation.is_settled)
        origin = Origin(unit.id, bearing, estimator, 1, AUTHOR, now_ns, EVENT)
        learned = learn(
            history, operation.is_settled, origin, settings.baseline.settings(1.0 / 6.0)
        )
        films = judged(history, operation, learned, rules)
        store.add_past(unit.id, bearing, estimator, films, _trends(history, estimator))
        store.add_baseline(learned, [_step(learned, step) for step in STEPS])
    response = learn_response(past, np.logical_and.reduce(settled))
    if response is not None:
        store.set_response(unit.id, response, now_ns)


STEPS = (BaselineStep.LEARNED, BaselineStep.ACCEPTED)


def _step(learned: BearingBaseline, step: BaselineStep) -> StoredStep:
    origin = learned.origin
    return StoredStep(origin.unit, origin.bearing, 1, step, origin.created_ns, AUTHOR, EVENT)


def judged(
    history: StiffnessHistory,
    operation: OperationHistory,
    learned: BearingBaseline,
    rules: FilmRules,
) -> FilmHistory:
    """A history with what would have been said of it under its own baseline."""
    found = [learned.of(direction) for direction in DIRECTIONS]
    quantities = [quantity for quantity in found if quantity is not None]
    if len(quantities) < len(DIRECTIONS):
        raise ValueError(f"nothing was learned of {learned.origin.bearing}: too few readings")
    said = [
        decide_all(history, operation.is_settled, q.direction, q, rules.change) for q in quantities
    ]
    deviations = [_deviation(history, operation.is_settled, q) for q in quantities]
    return FilmHistory(
        history=history,
        state=operation.state,
        is_settled=operation.is_settled,
        is_simulated=np.ones(len(history), np.bool_),
        verdict=np.stack([one.verdict for one in said]),
        level=np.stack([one.level for one in said]),
        change=np.stack([one.change for one in said]),
        change_std=np.stack([_std(one) for one in said]),
        deviation=np.stack([deviation for deviation, _ in deviations]),
        deviation_std=np.stack([std for _, std in deviations]),
        baseline_version=np.ones(len(history), np.int64),
    )


def _std(said: DecisionHistory) -> FloatArray:
    sure = np.where(said.significance > 0.0, said.significance, np.nan)
    return np.asarray(np.abs(said.change) / sure)


def _deviation(
    history: StiffnessHistory, is_settled: npt.NDArray[np.bool_], learned: QuantityBaseline
) -> tuple[FloatArray, FloatArray]:
    row = DIRECTIONS.index(learned.direction)
    found = learned.compare(history.conditions, history.ln_k[row], history.u_random[row])
    is_compared = is_settled & (found.place >= 0)
    std = np.hypot(found.scatter, found.surface_std)
    return np.where(is_compared, found.deviation, np.nan), np.where(is_compared, std, np.nan)


def _trends(history: StiffnessHistory, estimator: Estimator) -> dict[str, FloatArray]:
    """Columns of the store's layout, as far as a life knows them."""
    columns = {
        "speed_rpm": history.speed_rpm,
        "power_mw": history.power_mw,
        "oil_temperature_c": history.oil_temperature_c,
        "eccentricity_ratio": history.eccentricity_ratio,
        "attitude_angle_deg": history.attitude_deg,
    }
    for row, direction in enumerate(DIRECTIONS):
        k_n_per_m = np.exp(history.ln_k[row])
        for name in ("stiffness_{axes}_n_per_m", ESTIMATORS[estimator].stiffness):
            columns[name.format(axes=direction * 2)] = k_n_per_m
        columns[f"order1_shaft_{direction}_um_pk"] = history.shaft_um_pk[row]
        columns[f"order1_bearing_{direction}_um_pk"] = history.bearing_um_pk[row]
    return columns
