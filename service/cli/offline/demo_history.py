"""Simulated year before the first start: readings, a baseline learned from them, and trends."""

import signal
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import groupby
from multiprocessing import get_context
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from core.arrays import FloatArray
from core.baseline.baseline import BearingBaseline, Origin, QuantityBaseline
from core.baseline.history import DIRECTIONS, QUANTITIES, StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.backtest import DecisionHistory, OperationHistory, decide_all, operation_history
from core.change.settings import FilmRules
from core.change.shaft_response import learn_response
from core.machine.unit import Estimator
from core.stiffness.estimators import ESTIMATORS
from service.settings.core_values import film_rules_of
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings
from service.store.baselines import BaselineStep, StoredStep
from service.store.film_readings import FilmHistory
from service.store.films import FilmStore

AUTHOR = "padwatch demo"
EVENT = "learned from a simulated year"


def without_past(store: FilmStore, plant: PlantFile) -> list[UnitSettings]:
    """Return the units that have monitored films, but no film readings in the store."""
    return [unit for unit, _ in _new_units(store, plant)]


def _new_units(store: FilmStore, plant: PlantFile) -> Iterator[tuple[UnitSettings, FilmRules]]:
    for unit in plant.unit:
        rules = film_rules_of(unit, plant.films)
        if isinstance(rules, FilmRules) and not any(
            store.first_ns(unit.id, bearing, estimator) is not None
            for bearing, estimator in rules.estimators.items()
        ):
            yield unit, rules


def fill(
    store: FilmStore,
    plant: PlantFile,
    pasts: Mapping[str, Mapping[str, StiffnessHistory]],
    now_ns: int,
) -> None:
    """Store simulated readings, a baseline and trends of units that have no readings.

    Parameters
    ----------
    pasts
        Readings until now, by unit and bearing; a unit without readings is not changed.
    now_ns
        Time of the baseline and of its acceptance, ns since 1970 UTC.

    Raises
    ------
    StoreError
        If the store cannot be read or written.
    """
    every_ten_minutes = plant.films.baseline.settings(1.0 / 6.0)
    films = [
        (
            *(pasts[unit.id][bearing], rules, every_ten_minutes),
            Origin(unit.id, bearing, estimator, 1, AUTHOR, now_ns, EVENT),
        )
        for unit, rules in _new_units(store, plant)
        if pasts.get(unit.id)
        for bearing, estimator in rules.estimators.items()
    ]
    ignoring_interrupts = (signal.signal, (signal.SIGINT, signal.SIG_IGN))
    # two processes, because a user waits for the first page
    with get_context("spawn").Pool(2, *ignoring_interrupts) as pool:
        found = pool.imap(_past_of, films)
        for unit_id, bearings in groupby(found, lambda past: past[1].origin.unit):
            _fill_unit(store, pasts[unit_id], bearings, now_ns)


Past: TypeAlias = tuple[FilmHistory, BearingBaseline, dict[str, FloatArray]]
"""Readings of a bearing with decisions, the baseline learned from them, and trends."""


def _past_of(film: tuple[StiffnessHistory, FilmRules, BaselineSettings, Origin]) -> Past:
    history, rules, settings, origin = film
    estimator = Estimator(origin.estimator)
    if ESTIMATORS[estimator].ck is None:
        nothing = np.full(history.ln_ck.shape, np.nan)
        history = replace(history, ln_ck=nothing, u_ck=nothing)
    operation = operation_history(
        *(history.time_ns, history.speed_rpm, history.power_mw, rules.operating),
        history.oil_temperature_c,
    )
    learned = learn(history, operation.is_settled, origin, settings)
    return judged(history, operation, learned, rules), learned, _trends(history, estimator)


def _fill_unit(
    store: FilmStore,
    past: Mapping[str, StiffnessHistory],
    bearings: Iterable[Past],
    now_ns: int,
) -> None:
    settled = []
    for films, learned, trends in bearings:
        of = learned.origin
        settled.append(films.is_settled)
        store.add_past(of.unit, of.bearing, Estimator(of.estimator), films, trends)
        steps = [
            StoredStep(of.unit, of.bearing, 1, step, now_ns, AUTHOR, EVENT)
            for step in (BaselineStep.LEARNED, BaselineStep.ACCEPTED)
        ]
        store.add_baseline(learned, steps)
    response = learn_response(past, np.logical_and.reduce(settled))
    if response is not None:
        store.set_response(of.unit, response, now_ns)


def judged(
    history: StiffnessHistory,
    operation: OperationHistory,
    learned: BearingBaseline,
    rules: FilmRules,
) -> FilmHistory:
    """Compare a history with the baseline learned from it; return readings and decisions.

    Raises `ValueError` if the stiffness in a direction has no baseline.
    """
    if any(learned.of(f"k_{direction}") is None for direction in DIRECTIONS):
        raise ValueError(f"bearing {learned.origin.bearing}: too few readings for a baseline")
    decided = [
        decide_all(history, operation.is_settled, name, learned.of(name), rules.limits(name))
        for name in QUANTITIES
    ]
    deviations = [
        _deviation(history, operation.is_settled, learned.of(name)) for name in QUANTITIES
    ]
    return FilmHistory(
        history=history,
        state=operation.state,
        is_settled=operation.is_settled,
        is_simulated=np.ones(len(history), np.bool_),
        verdict=np.stack([one.verdict for one in decided]),
        level=np.stack([one.level for one in decided]),
        change=np.stack([one.change for one in decided]),
        change_std=np.stack([_std(one) for one in decided]),
        deviation=np.stack([deviation for deviation, _ in deviations]),
        deviation_std=np.stack([std for _, std in deviations]),
        baseline_version=np.ones(len(history), np.int64),
    )


def _std(decided: DecisionHistory) -> FloatArray:
    significance = np.where(decided.significance > 0.0, decided.significance, np.nan)
    return np.asarray(np.abs(decided.change) / significance)


def _deviation(
    history: StiffnessHistory, is_settled: npt.NDArray[np.bool_], learned: QuantityBaseline | None
) -> tuple[FloatArray, FloatArray]:
    if learned is None:
        return np.full(len(history), np.nan), np.full(len(history), np.nan)
    found = learned.compare_history(history)
    is_compared = is_settled & (found.place >= 0)
    std = np.hypot(found.scatter, found.surface_std)
    return np.where(is_compared, found.deviation, np.nan), np.where(is_compared, std, np.nan)


def _trends(history: StiffnessHistory, estimator: Estimator) -> dict[str, FloatArray]:
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
        if (ck := ESTIMATORS[estimator].ck) is not None:
            columns[ck.format(axes=direction * 2)] = np.exp(history.ln_ck[row])
        columns[f"order1_shaft_{direction}_um_pk"] = history.shaft_um_pk[row]
        columns[f"order1_bearing_{direction}_um_pk"] = history.bearing_um_pk[row]
    return columns
