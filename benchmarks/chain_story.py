"""A day of a simulated unit that was learned for a year: another condition, then damage."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from acquisition.simulated.life.damage import Damage, DamageKind
from acquisition.simulated.life.excitation import rotor_of
from acquisition.simulated.life.life import live
from acquisition.simulated.life.moment import (
    TRANSDUCER_NOISE,
    bearing_at,
    channels_at,
    hydraulic_noise,
    vortex_rope,
)
from acquisition.simulated.life.truth import UnitLife
from acquisition.simulated.plant.scenario import Scenario
from benchmarks.chain_unit import UNIT, Window
from benchmarks.detection_cases import four_fold
from benchmarks.detection_unit import (
    BRACKETS_N_PER_M,
    DAY_NS,
    SETTINGS,
    START_NS,
    YEARS,
    LearnedUnit,
)
from core.baseline.history import ReadingOutcome
from core.change.film_judge import FilmJudge, FilmNews
from core.change.film_reading import FilmReading, FilmValue
from core.change.settings import ChangeLimits, FilmRules
from core.condition.cells import BearingCondition
from core.condition.operating_state import (
    UNKNOWN_OPERATION,
    OperatingLimits,
    Operation,
    step_operation,
)
from core.machine.unit import Estimator
from core.quality import Reason
from core.units import ns_from_s

ROWS_PER_H = 6
HOUR_NS = 3_600 * 10**9
WARM_UP_H = 12
"""Of operation before the stretch, from which it is known whether the unit has settled."""

REASONS = {
    ReadingOutcome.MEASURED: Reason.OK,
    ReadingOutcome.INSUFFICIENT_EXCITATION: Reason.INSUFFICIENT_EXCITATION,
    ReadingOutcome.BAD_QUALITY: Reason.SENSOR_FAILURE,
}


@dataclass(frozen=True)
class Story:
    """When what happens, in hours from the first reading that is judged.

    Parameters
    ----------
    seed
        Of the unit's life.
    day
        Of the second year, on which it begins.
    change_h
        When the shaft goes far out in cold oil, after a day near the centre in warm oil; or the
        other way round.
    damage_h
        When a film loses a share of its stiffness.
    """

    seed: int
    day: float
    bearing: str = "UJB"
    loss: float = 0.2
    hours: float = 24.0
    change_h: float = 7.0
    damage_h: float = 16.0
    stiffer: bool = True

    @property
    def begins_ns(self) -> int:
        return START_NS + round((365.0 + self.day) * DAY_NS)

    def at_ns(self, hour: float) -> int:
        return self.begins_ns + round(hour * HOUR_NS)

    def life(self) -> UnitLife:
        damage = Damage(
            DamageKind.STIFFNESS_LOSS, self.bearing, self.at_ns(self.damage_h), self.loss
        )
        change = four_fold(self.at_ns(self.change_h), 1.0, stiffer=self.stiffer)
        return live(self.seed, START_NS, YEARS, [damage], change)

    def rows(self, life: UnitLife) -> npt.NDArray[np.int64]:
        time_ns = life.operation.time_ns
        is_in = (time_ns >= self.begins_ns) & (time_ns < self.at_ns(self.hours))
        return np.flatnonzero(is_in & life.operation.is_at_speed)


def windows(life: UnitLife, rows: npt.NDArray[np.int64]) -> Iterator[Window]:
    """What is sampled for each reading."""
    for row in rows.tolist():
        yield Window(int(life.operation.time_ns[row]), scenario_at(life, row), row)


def scenario_at(life: UnitLife, row: int) -> Scenario:
    """Steady operation at a reading, with the transducer errors of the reading."""
    load = float(life.operation.load[row])
    grow = {b.id for b in UNIT.bearings if b.opposite_reference_um is not None}
    return Scenario(
        bearings={
            id_: bearing_at(truth, row, id_ in grow, float(np.median(truth.clearance_um)))
            for id_, truth in life.truth.items()
        },
        speed_rpm=float(life.operation.speed_rpm[row]),
        active_power_mw=float(life.operation.power_mw[row]),
        unbalance_grade_mm_s=float(life.grade_mm_s[row]),
        hydraulic=hydraulic_noise(load),
        rope=vortex_rope(load),
        noise=TRANSDUCER_NOISE,
        channels={
            channel: one
            for bearing in UNIT.bearings
            for channel, one in channels_at(life.truth[bearing.id], row, bearing)
        },
        rotor=rotor_of(tuple(life.truth)),
    )


def from_readings(life: UnitLife, row: int) -> list[FilmReading]:
    """The readings of one row as the life gives them, their condition yet to be told."""
    return [_from_readings(life, bearing, row) for bearing in life.readings]


def _from_readings(life: UnitLife, bearing: str, row: int) -> FilmReading:
    history = life.readings[bearing]
    values = tuple(
        FilmValue(
            float(history.ln_k[axis, row]),
            float(history.u_random[axis, row]),
            float(history.shaft_um_pk[axis, row]),
            float(history.bearing_um_pk[axis, row]),
            outcome := ReadingOutcome(int(history.outcome[axis, row])),
            REASONS[outcome],
        )
        for axis in range(2)
    )
    return FilmReading(
        *(UNIT.id, bearing, Estimator.DYNAMIC, int(history.time_ns[row])),
        BearingCondition(UNKNOWN_OPERATION.state, False, None),
        float(history.speed_rpm[row]),
        float(history.power_mw[row]),
        float(history.eccentricity_ratio[row]),
        float(history.u_eccentricity[row]),
        float(history.attitude_deg[row]),
        float(history.oil_temperature_c[row]),
        (values[0], values[1]),
    )


def silenced(measured: Sequence[FilmReading], life: UnitLife, row: int) -> list[FilmReading]:
    """Measured readings without those that transducers out of order had no part in."""
    return [
        replace(reading, values=tuple(v for v in _silenced(reading, life, row)))
        for reading in measured
    ]


def _silenced(reading: FilmReading, life: UnitLife, row: int) -> Iterator[FilmValue]:
    outcome = life.readings[reading.bearing].outcome[:, row]
    for value, said in zip(reading.values, outcome.tolist(), strict=True):
        if said == ReadingOutcome.MEASURED:
            yield value
        else:
            nan, why = float("nan"), ReadingOutcome(said)
            yield FilmValue(nan, nan, value.shaft_um_pk, value.bearing_um_pk, why, REASONS[why])


class Watch:
    """Judges readings of one depth with what was learned from a year of the other.

    Parameters
    ----------
    life, first
        From whose operation before the first row it is known what the unit does.
    """

    def __init__(self, learned: LearnedUnit, life: UnitLife, first: int) -> None:
        operation = life.operation
        self._limits = OperatingLimits(operation.rated_speed_rpm, operation.rated_power_mw)
        rules = FilmRules(
            dict.fromkeys(learned.baselines, Estimator.DYNAMIC),
            SETTINGS.grid,
            self._limits,
            ChangeLimits(),
            ns_from_s(operation.step_s),
        )
        self._judge = FilmJudge(rules, BRACKETS_N_PER_M)
        for bearing, baseline in learned.baselines.items():
            self._judge.activate_baseline(bearing, baseline)
        self._judge.response = learned.response
        self._operation = UNKNOWN_OPERATION
        for row in range(max(first - WARM_UP_H * ROWS_PER_H, 0), first):
            self._operate(
                int(operation.time_ns[row]),
                float(operation.speed_rpm[row]),
                float(operation.power_mw[row]),
            )

    def judge(self, readings: Sequence[FilmReading]) -> list[FilmNews]:
        one = readings[0]
        self._operate(one.time_ns, one.speed_rpm, one.power_mw)
        settled = self._operation.is_settled(self._limits)
        condition = BearingCondition(self._operation.state, settled, None)
        return self._judge.judge([replace(r, condition=condition) for r in readings])

    @property
    def operation(self) -> Operation:
        return self._operation

    def _operate(self, time_ns: int, speed_rpm: float, power_mw: float) -> None:
        self._operation = step_operation(
            self._operation, time_ns, speed_rpm, power_mw, self._limits
        )
