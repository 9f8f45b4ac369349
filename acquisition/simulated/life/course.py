"""Simulated life of a unit: scenarios over time for live samples, and readings until now."""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
import numpy.typing as npt

from acquisition.simulated.life.bearing import LIFE_BEARINGS
from acquisition.simulated.life.damage import Damage, alteration
from acquisition.simulated.life.excitation import rotor_of
from acquisition.simulated.life.films import film_course, mean_clearance_um, row_between, rows_of
from acquisition.simulated.life.inputs import BearingInputs, LifeInputs, draw_inputs
from acquisition.simulated.life.life import life_of, require_known_bearings
from acquisition.simulated.life.moment import (
    TRANSDUCER_NOISE,
    bearing_at,
    channels_at,
    hydraulic_noise,
    vortex_rope,
)
from acquisition.simulated.life.operation import DAY_NS, YEAR_S, HeldLoad, Operation
from acquisition.simulated.life.truth import BearingMoments, UnitLife
from acquisition.simulated.plant.scenario import HydraulicNoise, Scenario, TransducerNoise
from core.machine.unit import Unit
from core.units import NS_PER_S, ns_from_s

MIN_FILM_SPEED = 0.2
"""Minimum speed for the film stiffness, as a share of rated speed. A slow shaft has almost no film,
but the excitation is negligible too."""


class LifeCourse:
    """Operating conditions of a simulated unit over time, interpolated between 10-minute steps.

    Standstill can be sampled too: forces scale with the square of the speed, so that only
    transducer noise, gaps and oil temperatures remain.

    Parameters
    ----------
    damage
        Damage, which begins at its exact onset, not at the next reading.
    machine
        Unit to be sampled; its bearings must be in the life. With clearances equal to
        `LifeBearing.configured_clearance_um` the eccentricity equals that of the readings.
    start_ns
        Time of the first sample, ns since 1970 UTC.

    Raises
    ------
    ValueError
        If damage names an unknown bearing, or `start_ns` is outside the life.
    KeyError
        If a bearing of the machine is missing from the life.
    """

    def __init__(
        self,
        inputs: LifeInputs,
        damage: tuple[Damage, ...],
        machine: Unit,
        start_ns: int,
        noise: TransducerNoise = TRANSDUCER_NOISE,
    ) -> None:
        require_known_bearings(damage, tuple(one.bearing for one in inputs.bearings))
        self._inputs, self._damage, self._noise = inputs, damage, noise
        self._machine, self._start_ns = machine, start_ns
        self._bearings = {one.bearing.id: one for one in inputs.bearings}
        turns = inputs.operation.is_turning
        self._usual_um = {
            one.bearing.id: _usual_clearance_um(one, turns) for one in inputs.bearings
        }
        # gaps of four probes include thermal growth, which two probes cannot separate
        opposite = {b.id: b.opposite_reference_um for b in machine.bearings}
        self._growing = frozenset(id_ for id_, um in opposite.items() if um is not None)
        self._n_rows = len(inputs.operation)
        self._rotor = rotor_of(tuple(self._bearings))
        self.at(0.0)

    @property
    def rated_speed_rpm(self) -> float:
        """Rated speed of the unit."""
        return self._inputs.operation.rated_speed_rpm

    def at(self, elapsed_s: float) -> Scenario:
        """Return the scenario at `elapsed_s` seconds after the first sample.

        Raises ValueError if the time is after the end of the life.
        """
        time_ns = self._start_ns + ns_from_s(elapsed_s)
        row, share = self._place(time_ns)
        operation = row_between(self._inputs.operation, self._n_rows, row, share)
        moments = {
            id_: self._moment(inputs, operation, time_ns, (row, share))
            for id_, inputs in self._bearings.items()
        }
        grade_mm_s = self._inputs.grade_mm_s[row : row + 2]
        return Scenario(
            bearings={
                id_: bearing_at(moment, 0, id_ in self._growing, self._usual_um[id_])
                for id_, moment in moments.items()
            },
            speed_rpm=float(operation.speed_rpm[0]),
            active_power_mw=float(operation.power_mw[0]),
            unbalance_grade_mm_s=float(grade_mm_s @ (1.0 - share, share)),
            hydraulic=self._hydraulic(operation),
            rope=vortex_rope(float(operation.load[0])),
            noise=self._noise,
            channels={
                channel: one
                for bearing in self._machine.bearings
                for channel, one in channels_at(moments[bearing.id], 0, bearing)
            },
            rotor=self._rotor,
        )

    def _place(self, time_ns: int) -> tuple[int, float]:
        """Return the row at or before a time, and the fraction of the interval to the next row."""
        grid_ns = self._inputs.operation.time_ns
        row = int(np.searchsorted(grid_ns, time_ns, side="right")) - 1
        if not 0 <= row < self._n_rows - 1:
            seed = self._inputs.unit_seed
            span = f"from {grid_ns[0]} to before {grid_ns[-1]} ns"
            raise ValueError(f"time {time_ns} ns is outside the life of unit {seed}, {span}")
        return row, float(time_ns - grid_ns[row]) / float(grid_ns[row + 1] - grid_ns[row])

    def _moment(
        self,
        inputs: BearingInputs,
        operation: Operation,
        time_ns: int,
        place: tuple[int, float],
    ) -> BearingMoments:
        n = self._n_rows
        here = row_between(inputs, n, *place)
        thermal = row_between(inputs.thermal, n, *place)
        altered = alteration(self._damage, inputs.bearing.id, np.array([time_ns]))
        min_rpm = MIN_FILM_SPEED * self.rated_speed_rpm
        speed_rpm = np.maximum(operation.speed_rpm, min_rpm)
        course = film_course(
            *(inputs.bearing, inputs.setting, thermal, speed_rpm, here.position_um),
            altered,
            inputs.worn_pad,
        )
        return BearingMoments(
            film=course.film,
            clearance_um=course.clearance_um,
            centre_um=course.centre_um,
            oil_temperature_c=thermal.oil_temperature_c,
            altered=altered,
            chain=row_between(inputs.chain, n, *place),
        )

    def _hydraulic(self, operation: Operation) -> HydraulicNoise:
        """Return the broadband hydraulic force, zero at standstill."""
        share = min(float(operation.speed_rpm[0]) / self.rated_speed_rpm, 1.0)
        running = hydraulic_noise(float(operation.load[0]))
        return HydraulicNoise(share**2 * running.rms_n, running.cutoff_hz)


def _usual_clearance_um(inputs: BearingInputs, turns: npt.NDArray[np.bool_]) -> float:
    thermal = rows_of(inputs.thermal, turns)
    return float(np.median(mean_clearance_um(inputs.bearing, inputs.setting, thermal)))


YEARS = 3.0
"""Duration of a life in years: last year, this year and next year."""


@dataclass(frozen=True)
class LifePlan:
    """Parameters of the simulated life of a unit.

    Parameters
    ----------
    seed
        Random seed; even for a unit of 92.3 r/min, odd for 90.9 r/min.
    held_load
        Constant load as a share of rated power, without a stop since the beginning of yesterday
        (UTC); None for random starts and stops.
    """

    seed: int
    held_load: float | None = None
    damage: tuple[Damage, ...] = ()


def history_until(plan: LifePlan, now_ns: int, years: float = 1.0) -> UnitLife:
    """Return the readings and the true state of a life until `now_ns`, ns since 1970 UTC.

    `years` is the length of the history; up to one year is always available.

    Raises ValueError if the history begins before the life, or damage has an unknown bearing.
    """
    require_known_bearings(plan.damage, LIFE_BEARINGS)
    inputs = _inputs(plan, now_ns)
    time_ns, from_ns = inputs.operation.time_ns, now_ns - ns_from_s(years * YEAR_S)
    if from_ns < time_ns[0] - DAY_NS:
        raise ValueError(
            f"years = {years:g} is longer than the life of unit {plan.seed}; use 1 or less"
        )
    selected = inputs.operation.is_turning & (time_ns >= from_ns) & (time_ns < now_ns)
    return life_of(inputs, plan.damage, np.asarray(selected))


def course_from(
    plan: LifePlan, now_ns: int, machine: Unit, noise: TransducerNoise = TRANSDUCER_NOISE
) -> LifeCourse:
    """Return the scenarios of a life from `now_ns`, ns since 1970 UTC, to the end of next year.

    Raises `ValueError` if damage has an unknown bearing, and `KeyError` if a bearing of the machine
    is missing from the life.
    """
    return LifeCourse(_inputs(plan, now_ns), plan.damage, machine, now_ns, noise)


def _inputs(plan: LifePlan, now_ns: int) -> LifeInputs:
    held = None
    if plan.held_load is not None:
        held = HeldLoad((now_ns // DAY_NS - 1) * DAY_NS, plan.held_load)
    return draw_inputs(plan.seed, _last_new_year_ns(now_ns), YEARS, held=held)


def _last_new_year_ns(now_ns: int) -> int:
    """Return the start of last year (UTC), in ns since 1970."""
    year = datetime.fromtimestamp(now_ns // NS_PER_S, UTC).year - 1
    return int(datetime(year, 1, 1, tzinfo=UTC).timestamp()) * NS_PER_S
