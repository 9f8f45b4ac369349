"""Random inputs of a simulated life: operation, temperatures, positions, transducer errors."""

from dataclasses import dataclass

import numpy as np

from acquisition.simulated.life.bearing import (
    LIFE_BEARINGS,
    LifeBearing,
    ThermalCourse,
    draw_closing_share,
    draw_water_c,
    thermal_course,
)
from acquisition.simulated.life.excitation import draw_grade_mm_s
from acquisition.simulated.life.films import PadSetting, draw_setting, worn_pad
from acquisition.simulated.life.operation import HeldLoad, Operation, draw_operation, time_grid_ns
from acquisition.simulated.life.shaft import ConditionChange, draw_positions_um
from acquisition.simulated.life.truth import Chain, draw_chain
from core.arrays import FloatArray

RATED_SPEEDS_RPM = (92.3, 90.9)
"""Rated speeds of 60 Hz units (even seeds) and 50 Hz units (odd) (Brito et al., section 1)."""


@dataclass(frozen=True, eq=False)
class BearingInputs:
    """Simulation inputs of one bearing at evenly spaced times, without damage.

    Parameters
    ----------
    position_um : (2, n)
        Position of the shaft centre relative to the bearing centre.
    worn_pad
        Index of the pad nearest to the median shaft position while turning.
    """

    bearing: LifeBearing
    setting: PadSetting
    thermal: ThermalCourse
    position_um: FloatArray
    chain: Chain
    worn_pad: int


@dataclass(frozen=True, eq=False)
class LifeInputs:
    """Simulation inputs of one unit at evenly spaced times.

    Parameters
    ----------
    water_c : (n,)
        Cooling water temperature.
    grade_mm_s : (n,)
        Residual unbalance as an ISO balance grade.
    noise
        Seeds of the random errors of the readings, in the order of `bearings`.
    """

    unit_seed: int
    operation: Operation
    water_c: FloatArray
    grade_mm_s: FloatArray
    bearings: tuple[BearingInputs, ...]
    noise: tuple[np.random.SeedSequence, ...]
    changes: tuple[ConditionChange, ...]


def draw_inputs(
    unit_seed: int,
    start_ns: int,
    years: float,
    changes: tuple[ConditionChange, ...] = (),
    bearings: tuple[LifeBearing, ...] = LIFE_BEARINGS,
    held: HeldLoad | None = None,
) -> LifeInputs:
    """Draw the random inputs of a life.

    Parameters
    ----------
    start_ns
        Time of the first row: midnight in the time zone of the plant.
    changes
        Changes of the operating condition without damage.
    held
        Operation at constant load; None for random starts and stops.

    Raises
    ------
    ValueError
        If `years` is less than a day, or the unit never turns.
    """
    random = _Streams(unit_seed, len(bearings))
    time_ns = time_grid_ns(start_ns, years)
    operation = draw_operation(random.operation, time_ns, rated_speed_rpm(unit_seed), held)
    if not operation.is_turning.any():
        raise ValueError(f"unit {unit_seed} never runs in {years:g} years; use a longer time")
    water_c = draw_water_c(random.water, operation)
    positions_um = draw_positions_um(random.position, operation, bearings, changes)
    drawn = (
        _bearing(bearing, setting, chain, positions_um[bearing.id], operation, water_c, changes)
        for bearing, setting, chain in zip(bearings, random.settings, random.chains, strict=True)
    )
    return LifeInputs(
        unit_seed,
        operation,
        water_c,
        draw_grade_mm_s(random.unbalance, operation),
        tuple(drawn),
        tuple(random.noises),
        changes,
    )


def rated_speed_rpm(unit_seed: int) -> float:
    """Return the rated speed in r/min of the simulated unit with the seed `unit_seed`."""
    return RATED_SPEEDS_RPM[unit_seed % 2]


class _Streams:
    """Independent random generators of operation, water, position, unbalance and bearings."""

    def __init__(self, unit_seed: int, n_bearings: int) -> None:
        plant, *own = np.random.SeedSequence(unit_seed).spawn(1 + 3 * n_bearings)
        self.operation, self.water, self.position, self.unbalance = (
            np.random.default_rng(seed) for seed in plant.spawn(4)
        )
        self.settings, self.chains = (
            [np.random.default_rng(seed) for seed in own[i::3]] for i in range(2)
        )
        self.noises = own[2::3]


def _bearing(
    bearing: LifeBearing,
    setting: np.random.Generator,
    chain: np.random.Generator,
    position_um: FloatArray,
    operation: Operation,
    water_c: FloatArray,
    changes: tuple[ConditionChange, ...],
) -> BearingInputs:
    pads, oil_offset_c = draw_setting(setting, bearing), np.zeros(len(operation))
    for change in changes:
        oil_offset_c += change.oil_offset_c * change.holds(operation.time_ns)
    closing_share = draw_closing_share(setting, operation)
    return BearingInputs(
        bearing,
        pads,
        thermal_course(bearing, operation, water_c, closing_share, oil_offset_c),
        position_um,
        draw_chain(chain, operation),
        worn_pad(bearing, position_um[:, operation.is_turning]),
    )
