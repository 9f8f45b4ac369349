"""A moment of a life, sampled at 600 Hz and analysed, gives the film that the life had."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from acquisition.simulated.life.damage import Damage, DamageKind
from acquisition.simulated.life.life_truth import UnitLife
from acquisition.simulated.life.moment import row_at, scenario_at
from benchmarks.accuracy_plant import machine
from core.machine import Measurand

Life = Callable[..., UnitLife]
Day = Callable[[float], int]
MACHINE = machine(Measurand.ACCELERATION_M_S2)


def running_ns(life: UnitLife, from_ns: int) -> int:
    """First reading under load from then on."""
    operation = life.operation
    return int(operation.time_ns[(operation.time_ns >= from_ns) & (operation.load > 0.5)][0])


def test_a_scenario_holds_what_was_so_at_that_moment(two_years: Life, day_ns: Day) -> None:
    damage = (
        Damage(DamageKind.BRACKET_LOOSENING, "LJB", day_ns(100), 0.2),
        Damage(DamageKind.ACCELEROMETER_GAIN, "UJB", day_ns(100), -0.2, directions=("y",)),
    )
    life = two_years(1, *damage)
    moment_ns = running_ns(life, day_ns(200))
    row, scenario = row_at(life, moment_ns), scenario_at(life, moment_ns, MACHINE)
    truth, bearing = life.truth["UJB"], scenario.bearings["UJB"]

    assert math.log(bearing.film.k_yy_n_per_m) == pytest.approx(truth.ln_k[1, row])
    assert bearing.centre_x_um == truth.centre_um[0, row]
    assert bearing.oil_temperature_c == truth.oil_temperature_c[row]
    assert scenario.active_power_mw == life.operation.power_mw[row]
    assert scenario.bearings["LJB"].bracket_stiffness_factor == pytest.approx(0.8)
    assert np.max(np.abs(life.truth["LJB"].film_loss)) == 0.0
    chain = truth.chain
    strays = math.exp(chain.ln_k_error[1, row])
    assert scenario.channels["UJB_vy"].gain == pytest.approx(
        0.8 * chain.accelerometer_gain[1] * strays
    )
    assert scenario.channels["UJB_ux"].gain == chain.probe_gain[0]


def test_the_vortex_is_there_at_part_load_only(two_years: Life) -> None:
    life = two_years(0)
    loads, times = life.operation.load, life.operation.time_ns
    part, full = (
        scenario_at(life, int(times[np.flatnonzero(np.abs(loads - load) < 0.02)[0]]), MACHINE)
        for load in (0.57, 0.97)
    )

    assert part.rope.force_n > 0.0
    assert full.rope.force_n == 0.0
    assert part.hydraulic.rms_n > 0.0


def test_there_is_no_scenario_before_birth_nor_during_a_run_up(two_years: Life) -> None:
    life = two_years(0)
    with pytest.raises(ValueError, match="begins after 5 ns"):
        scenario_at(life, 5, MACHINE)
    run_up = np.flatnonzero(~life.operation.is_at_speed)[0]
    with pytest.raises(ValueError, match="not at speed"):
        scenario_at(life, int(life.operation.time_ns[run_up]), MACHINE)
