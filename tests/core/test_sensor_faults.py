"""What a failing transducer or an unsteady machine does to the results of the monitor."""

from dataclasses import replace

import numpy as np
import pytest

from core.arrays import FloatArray
from core.assessment import Assessment
from core.machine import Unit
from core.monitor import UnitMonitor
from core.quality import Reading, Reason, bad, uncertain
from core.settings import AnalysisSettings
from core.speed import SpeedSource

RATE_HZ = 600.0
STIFFNESS = ("order1_k_eff_xx_n_per_m", "order1_transfer_k_xx_n_per_m", "stiffness_xx_n_per_m")


def machine(duration_s: float = 90.0, speed_rpm: float = 92.3) -> FloatArray:
    """Shaft 60 µm and bearing 20 µm at 1×, forward, with a little noise."""
    time_s = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    turn = 2 * np.pi * speed_rpm / 60 * time_s
    signals = np.array(
        [
            2000 - 60 * np.cos(turn),
            2000 - 60 * np.sin(turn),
            20 * np.cos(turn - 0.1),
            20 * np.sin(turn - 0.1),
        ]
    )
    return signals + np.random.default_rng(4).normal(size=signals.shape) * 0.2


def watched(unit: Unit, stream) -> Assessment:
    monitor = UnitMonitor(unit, AnalysisSettings())
    return [a for block in stream for a in monitor.ingest(block)][-1]


@pytest.fixture
def in_counts(unit: Unit) -> Unit:
    """The unit with a converter of 0.1 µm a count."""
    return replace(unit, channels=tuple(replace(c, unit_per_count=0.1) for c in unit.channels))


@pytest.mark.parametrize(
    ("signal", "reason"), [(0.05, Reason.DEAD), (2000.0, Reason.STUCK), (-3.0, Reason.STUCK)]
)
def test_a_channel_that_stopped_moving_gives_no_number(
    in_counts: Unit, blocks, signal: float, reason: Reason
) -> None:
    signals = machine()
    flicker = np.random.default_rng(1).integers(0, 2, signals.shape[1]) * 0.1
    signals[0] = signal + flicker
    readings = watched(in_counts, blocks(signals)).readings
    assert readings["order1_shaft_x_um_pk"].quality == bad(reason)
    for name in (*STIFFNESS, "dynamic_k_yy_n_per_m"):
        assert readings[name].quality == bad(reason)
    assert readings["order1_k_eff_yy_n_per_m"].value == pytest.approx(1.18e9 / 3, rel=5e-3)


def test_a_channel_that_dies_within_a_segment_is_noticed_in_that_segment(
    in_counts: Unit, blocks
) -> None:
    signals = machine(14.0)
    signals[2, 7000:] = 0.0
    readings = watched(in_counts, blocks(signals)).readings
    assert readings["order1_bearing_x_um_pk"].quality == bad(Reason.DEAD)


def test_nothing_need_move_while_the_machine_stands(in_counts: Unit, blocks) -> None:
    signals = np.full((4, 9000), 2000.0)
    readings = watched(in_counts, blocks(signals, speed_rpm=0.0)).readings
    assert readings["gap_x_um"].value == 2000.0
    for name in STIFFNESS:
        assert readings[name].quality == bad(Reason.STANDSTILL)


def test_exchanged_transducers_are_doubted_until_the_rotation_is_told(unit: Unit, blocks) -> None:
    signals = machine()[[1, 0, 3, 2]]
    doubted = watched(unit, blocks(signals)).readings
    assert doubted["order1_k_eff_xx_n_per_m"].quality == uncertain(Reason.SWAPPED_AXES)
    told = watched(replace(unit, rotation_sense=-1), blocks(signals)).readings
    assert told["order1_k_eff_xx_n_per_m"].quality.reason is Reason.OK
    assert doubted["order1_roundness"].value == pytest.approx(-1.0, abs=0.01)


def test_a_speed_channel_that_the_line_contradicts_is_doubted(unit: Unit, blocks) -> None:
    newest = watched(unit, blocks(machine(), speed_rpm=97.0))
    assert newest.readings["speed_rpm"].quality == uncertain(Reason.SPEED_IMPLAUSIBLE)


def test_a_speed_that_no_machine_reaches_is_not_used(unit: Unit, blocks) -> None:
    for impossible in (-5.0, 900.0):
        newest = watched(unit, blocks(machine(), speed_rpm=impossible))
        assert newest.speed_source is SpeedSource.LINE
        assert newest.readings["speed_rpm"].value == pytest.approx(92.3, rel=2e-3)
        assert newest.readings["order1_shaft_x_um_pk"].value == pytest.approx(60.0, rel=5e-3)


@pytest.mark.parametrize(
    ("speeds", "powers"), [((92.3, 88.0), (650.0, 650.0)), ((92.3, 92.3), (650.0, 500.0))]
)
def test_a_record_in_which_speed_or_load_moved_is_doubted(
    unit: Unit, blocks, speeds: tuple[float, float], powers: tuple[float, float]
) -> None:
    halves = [list(blocks(machine(60.0, speed), speed_rpm=speed)) for speed in speeds]
    stream = [
        replace(
            block,
            first_index=half * 36000 + block.first_index,
            start_ns=half * 60 * 10**9 + block.start_ns,
            slow={**block.slow, "power": Reading(power)},
        )
        for half, (blocks_of_half, power) in enumerate(zip(halves, powers, strict=True))
        for block in blocks_of_half
    ]
    steady = watched(unit, stream[:600]).readings["order1_k_eff_xx_n_per_m"]
    moved = watched(unit, stream).readings["order1_k_eff_xx_n_per_m"]
    assert steady.quality.reason is Reason.OK
    assert moved.quality == uncertain(Reason.NON_STATIONARY)


def test_runout_that_could_be_all_of_the_motion_is_no_excitation(unit: Unit, blocks) -> None:
    rough = replace(unit, bearings=(replace(unit.bearings[0], runout_um_pk=20.0),))
    readings = watched(rough, blocks(machine())).readings
    assert readings["order1_k_eff_xx_n_per_m"].quality == bad(Reason.INSUFFICIENT_EXCITATION)
    slight = replace(unit, bearings=(replace(unit.bearings[0], runout_um_pk=10.0),))
    stated = watched(slight, blocks(machine())).readings["order1_k_eff_xx_n_per_m"]
    ideal = watched(unit, blocks(machine())).readings["order1_k_eff_xx_n_per_m"]
    assert stated.u_systematic > ideal.u_systematic


def test_the_papers_balanced_rows_have_no_stiffness(unit: Unit, blocks) -> None:
    """Table 8, balanced: shaft 10 to 23 µm, bearing 1.9 to 3.4 µm; unreliable, the paper says."""
    for shaft_um, bearing_um in ((23, 3.4), (12, 1.9), (10, 2.1)):
        scale = np.array([[shaft_um / 60], [shaft_um / 60], [bearing_um / 20], [bearing_um / 20]])
        readings = watched(unit, blocks(machine() * scale)).readings
        for name in STIFFNESS:
            assert readings[name].quality == bad(Reason.INSUFFICIENT_EXCITATION), (name, bearing_um)
