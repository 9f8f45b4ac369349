"""What a failing transducer or an unsteady machine does to the results of the monitor."""

from dataclasses import replace

import numpy as np
import pytest
from rigs.blocks import with_quality

import core.monitor.bearing_readings
from core.machine.channel import Channel, Measurand
from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD, Level, Reading, Reason, bad, uncertain
from core.stiffness.dynamic import films
from service.settings.bearings import BearingSettings

OMEGA = 2.0 * np.pi * 92.3 / 60.0
STIFFNESS = ("order1_k_eff_xx_n_per_m", "order1_transfer_k_xx_n_per_m", "stiffness_xx_n_per_m")


@pytest.fixture
def in_counts(unit: Unit) -> Unit:
    """The unit with a converter of 0.1 µm a count."""
    return replace(unit, channels=tuple(replace(c, unit_per_count=0.1) for c in unit.channels))


@pytest.mark.parametrize(
    ("signal", "reason"), [(0.05, Reason.DEAD), (2000.0, Reason.STUCK), (-3.0, Reason.STUCK)]
)
def test_a_channel_that_stopped_moving_gives_no_number(in_counts, results, signals, signal, reason):
    rows = signals(90.0)
    rows[0] = signal + np.random.default_rng(1).integers(0, 2, rows.shape[1]) * 0.1
    readings = results(rows, in_counts)[-1].readings
    for name in (*STIFFNESS, "order1_shaft_x_um_pk", "dynamic_k_yy_n_per_m"):
        assert readings[name].quality == bad(reason)
    assert readings["order1_k_eff_yy_n_per_m"].value == pytest.approx(1.18e9 / 3, rel=5e-3)


@pytest.mark.parametrize(("n_clipped", "is_few"), [(1, True), (100, False)])
def test_a_clipped_sample_costs_its_segment_not_results(unit, blocks, signals, n_clipped, is_few):
    """One sample of 8192 at the end of an accelerometer's range is 500 µm at 1×."""
    converter = tuple(replace(c, unit_per_count=0.1) for c in unit.channels)
    monitor = UnitMonitor(replace(unit, channels=converter), AnalysisSettings())
    rows = signals(90.0)
    where = rows.shape[1] - 5000 - 39 * np.arange(n_clipped)
    rows[2, where] = np.resize([3276.7, -3276.8], n_clipped)
    clipped = bad(Reason.CLIPPED)
    found = []
    for block in blocks(rows):
        at_end = bool((np.abs(block.samples[2]) > 3276.6).any())
        qualities = (*block.channel_quality[:2], clipped, block.channel_quality[3])
        found += monitor.steps(with_quality(block, qualities) if at_end else block)
    newest, expected = found[-1], uncertain(Reason.CLIPPED) if is_few else clipped
    assert newest.clipped_share["bearing_x"] == pytest.approx(n_clipped / 8192)
    for name in ("order1_bearing_x_um_pk", "overall_bearing_x_mm_s_rms", "stiffness_xx_n_per_m"):
        assert newest.readings[name].quality == expected
        before = found[-2].readings[name].value
        assert newest.readings[name].value == (pytest.approx(before, rel=1e-3) if is_few else None)
    assert newest.readings["order1_bearing_y_um_pk"].quality.reason is Reason.OK


def test_a_cable_that_clips_as_it_breaks_is_lost_at_once(unit, blocks, signals):
    converter = tuple(replace(c, unit_per_count=0.1) for c in unit.channels)
    monitor = UnitMonitor(replace(unit, channels=converter), AnalysisSettings())
    rows, found = signals(60.0), []
    rows[0, 29000:] = 0.0  # the last segment ends at 29,696
    rows[0, 29000:29010] = 3276.7
    for block in blocks(rows):
        is_clipped = bool((block.samples[0] > 3276.6).any())
        quality = bad(Reason.CLIPPED) if is_clipped else block.channel_quality[0]
        qualities = (quality, *block.channel_quality[1:])
        found += monitor.steps(with_quality(block, qualities))
    newest = found[-1]
    assert newest.window.stop_index == 29696
    assert newest.clipped_share["shaft_x"] == pytest.approx(10 / 8192)
    for name in ("order1_shaft_x_um_pk", "gap_x_um", "stiffness_xx_n_per_m"):
        assert newest.readings[name].quality.level is Level.BAD


def test_nothing_need_move_while_the_machine_stands(in_counts, results):
    readings = results(np.full((4, 9000), 2000.0), in_counts, speed_rpm=0.0)[-1].readings
    assert readings["gap_x_um"].value == 2000.0
    for name in STIFFNESS:
        assert readings[name].quality == bad(Reason.STANDSTILL)


def test_exchanged_transducers_and_a_speed_off_the_line_are_doubted(unit, results, signals):
    rows = signals(90.0)[[1, 0, 3, 2]]
    doubted = results(rows)[-1].readings
    assert doubted["order1_k_eff_xx_n_per_m"].quality == uncertain(Reason.SWAPPED_AXES)
    told = results(rows, replace(unit, rotation_sense=-1))[-1].readings
    assert told["order1_k_eff_xx_n_per_m"].quality.reason is Reason.OK
    assert doubted["order1_roundness"].value == pytest.approx(-1.0, abs=0.01)
    for speed_rpm, reason in ((92.4, Reason.OK), (92.7, Reason.SPEED_IMPLAUSIBLE)):
        newest = results(signals(60.0), speed_rpm=speed_rpm)[-1]
        assert newest.readings["speed_rpm"].quality.reason is reason
        assert newest.readings["order1_shaft_x_um_pk"].quality.reason is reason


@pytest.mark.parametrize(
    ("speeds", "powers"), [((92.3, 88.0), (650.0, 650.0)), ((92.3, 92.3), (650.0, 500.0))]
)
def test_a_record_in_which_speed_or_load_moved_is_doubted(unit, blocks, signals, speeds, powers):
    monitor, found = UnitMonitor(unit, AnalysisSettings()), []
    for half, (speed, power) in enumerate(zip(speeds, powers, strict=True)):
        rows = signals(60.0, speed_rpm=speed)
        for block in blocks(rows, first_index=half * rows.shape[1], speed_rpm=speed):
            slow = {**block.slow, "power": Reading(power)}
            found += monitor.steps(replace(block, elsewhere=slow))
    qualities = [a.readings["order1_k_eff_xx_n_per_m"].quality for a in found]
    assert qualities[3].reason is Reason.OK
    assert qualities[-1] == uncertain(Reason.NON_STATIONARY)


def test_runout_that_could_be_all_of_the_motion_is_no_excitation(unit, results, signals):
    ideal, slight, rough = (
        results(signals(90.0), replace(unit, bearings=(replace(bearing, runout_um_pk=runout),)))[-1]
        for bearing in unit.bearings
        for runout in (0.0, 10.0, 20.0)
    )
    name = "order1_k_eff_xx_n_per_m"
    assert rough.readings[name].quality == bad(Reason.INSUFFICIENT_EXCITATION)
    assert slight.readings[name].u_systematic > ideal.readings[name].u_systematic


@pytest.mark.parametrize(("shaft_um", "bearing_um"), [(23, 3.4), (12, 1.9), (10, 2.1)])
def test_the_papers_balanced_rows_have_no_stiffness(unit, results, signals, shaft_um, bearing_um):
    """Table 8, balanced: shaft 10 to 23 µm, bearing 1.9 to 3.4 µm; unreliable, the paper says."""
    assumed = BearingSettings.model_fields["runout_um_pk"].default
    unit = replace(unit, bearings=(replace(unit.bearings[0], runout_um_pk=assumed),))
    scale = np.array([[shaft_um / 60], [shaft_um / 60], [bearing_um / 20], [bearing_um / 20]])
    readings = results(signals(90.0, 0.2) * scale, unit)[-1].readings
    for name in STIFFNESS:
        assert readings[name].quality == bad(Reason.INSUFFICIENT_EXCITATION), name


@pytest.mark.parametrize(
    ("measurand", "amplitude"),
    [
        (Measurand.DISPLACEMENT_UM, 20.0),
        (Measurand.VELOCITY_MM_S, 20e-3 * OMEGA),
        (Measurand.ACCELERATION_M_S2, 20e-6 * OMEGA**2),
    ],
)
def test_a_line_below_the_noise_of_its_transducer_has_no_stiffness_in_whatever_unit(
    unit, results, signals, measurand, amplitude
):
    found = []
    for floor in (0.97, 1.03):
        noisy = (Channel(id_, measurand, line_floor=floor * amplitude) for id_ in ("bx", "by"))
        unit = replace(unit, channels=(*unit.channels[:2], *noisy))
        scale = np.array([[1.0], [1.0], [amplitude / 20.0], [amplitude / 20.0]])
        readings = results(signals(75.0) * scale, unit)[-1].readings
        found.append(readings["order1_k_eff_xx_n_per_m"].quality)
    assert found == [GOOD, bad(Reason.INSUFFICIENT_EXCITATION)]


def test_how_often_a_bearing_channel_is_integrated_follows_from_its_transducer(
    unit, results, signals, monkeypatch
):
    asked: list[tuple[int, int]] = []
    monkeypatch.setattr(
        core.monitor.bearing_readings,
        "films",
        lambda spectra, settings: (
            asked.extend(each.n_integrations for each in spectra) or films(spectra, settings)
        ),
    )
    velocity = Channel("bx", Measurand.VELOCITY_MM_S)
    acceleration = Channel("by", Measurand.ACCELERATION_M_S2)
    unit = replace(unit, channels=(*unit.channels[:2], velocity, acceleration))
    results(signals(15.0), unit)
    assert set(asked) == {(1, 2)}
