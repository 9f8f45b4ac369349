"""The unit monitor: from sample blocks to assessments, and what it refuses to say."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from core.account import Gap
from core.arrays import FloatArray
from core.assessment import Assessment
from core.blocks import Rejection, SampleBlock
from core.machine import Unit
from core.monitor import UnitMonitor
from core.quality import Level, Reason, bad
from core.settings import AnalysisSettings
from core.speed import SpeedSource

RATE_HZ = 600.0
HOP, SEGMENT = 7168, 8192


def machine_signals(duration_s: float, noise_um: float = 0.05, seed: int = 3) -> FloatArray:
    """Shaft 60 µm and bearing 20 µm at 92.3 r/min, a little noise, gaps of 1950 and 2060 µm."""
    time_s = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    turn = 2 * np.pi * 92.3 / 60 * time_s
    signals = np.array(
        [
            1950 - 60 * np.cos(turn),
            2060 - 60 * np.sin(turn),
            20 * np.cos(turn - 0.1),
            20 * np.sin(turn - 0.1),
        ]
    )
    return signals + noise_um * np.random.default_rng(seed).normal(size=signals.shape)


def watch(monitor: UnitMonitor, stream: Sequence[SampleBlock]) -> list[Assessment]:
    return [assessment for block in stream for assessment in monitor.ingest(block)]


@pytest.fixture
def monitor(unit: Unit) -> UnitMonitor:
    return UnitMonitor(unit, AnalysisSettings())


def test_the_first_result_comes_with_the_first_full_segment_and_then_every_hop(
    monitor: UnitMonitor, blocks
) -> None:
    counts = []
    for block in blocks(machine_signals(60.0), n_each=1):
        if monitor.ingest(block):
            counts.append(block.stop_index)
    assert counts == [SEGMENT + n * HOP for n in range(len(counts))]
    assert len(counts) == 4


def test_the_machine_reads_its_stiffness_and_position(monitor: UnitMonitor, blocks) -> None:
    newest = watch(monitor, list(blocks(machine_signals(60.0))))[-1]
    value = {name: reading.value for name, reading in newest.readings.items()}
    assert value["order1_shaft_x_um_pk"] == pytest.approx(60.0, rel=1e-3)
    assert value["order1_bearing_y_um_pk"] == pytest.approx(20.0, rel=1e-3)
    assert value["order1_k_eff_xx_n_per_m"] == pytest.approx(1.18e9 / 3, rel=2e-3)
    assert value["shaft_centre_x_um"] == pytest.approx(50.0, abs=1.0)
    assert value["shaft_centre_y_um"] == pytest.approx(-60.0, abs=1.0)
    assert value["eccentricity_ratio"] == pytest.approx(np.hypot(50, 60) / 200, abs=0.01)
    assert value["oil_temperature_c"] == 45.0
    assert newest.speed_source is SpeedSource.SLOW_CHANNEL
    assert newest.quality.level is Level.GOOD
    assert newest.window.coverage == 1.0


def test_results_do_not_depend_on_how_the_samples_are_cut(unit: Unit, blocks) -> None:
    signals = machine_signals(60.0)
    results = []
    for n_each in (1, 60, 8191, 100_000):
        monitor = UnitMonitor(unit, AnalysisSettings())
        results.append(watch(monitor, list(blocks(signals, n_each=n_each))))
    for other in results[1:]:
        assert [a.readings for a in other] == [a.readings for a in results[0]]
        # block times are whole nanoseconds, so the cut moves a time by one at the most
        assert [a.time_ns for a in other] == pytest.approx([a.time_ns for a in results[0]], abs=1)


def test_a_vortex_off_its_nominal_order_is_found_and_read_true(
    monitor: UnitMonitor, blocks
) -> None:
    signals = machine_signals(90.0)
    rope = 2 * np.pi * 0.283 * 92.3 / 60 * np.arange(signals.shape[1]) / RATE_HZ
    signals[0] -= 68.0 * np.cos(rope)
    signals[2] += 17.0 * np.cos(rope)
    newest = watch(monitor, list(blocks(signals)))[-1]
    assert newest.readings["vortex_frequency_hz"].value == pytest.approx(
        0.283 * 92.3 / 60, rel=0.01
    )
    assert newest.readings["vortex_shaft_x_um_pk"].value == pytest.approx(68.0, rel=0.01)
    assert newest.readings["vortex_k_eff_xx_n_per_m"].value == pytest.approx(1.18e9 / 4, rel=0.01)


@pytest.mark.parametrize("duration_s", [14.0, 200.0], ids=["one segment", "many segments"])
def test_without_a_vortex_there_is_no_stiffness_there(
    monitor: UnitMonitor, blocks, duration_s: float
) -> None:
    newest = watch(monitor, list(blocks(machine_signals(duration_s, noise_um=1.0))))[-1]
    reading = newest.readings["vortex_k_eff_xx_n_per_m"]
    assert reading.value is None
    assert reading.quality == bad(Reason.INSUFFICIENT_EXCITATION)
    assert newest.readings["order1_k_eff_xx_n_per_m"].value is not None


def test_coherent_noise_without_a_line_is_no_vortex(monitor: UnitMonitor, blocks) -> None:
    """Full load: hydraulic noise moves shaft and bearing together at every frequency."""
    signals = machine_signals(200.0)
    common = np.random.default_rng(8).normal(size=signals.shape[1])
    signals += np.array([[-6.0], [-6.0], [2.0], [2.0]]) * common
    newest = watch(monitor, list(blocks(signals)))[-1].readings
    assert newest["vortex_coherence_xx"].value > 0.95
    assert newest["vortex_k_eff_xx_n_per_m"].quality == bad(Reason.INSUFFICIENT_EXCITATION)


def test_transducer_noise_alone_never_makes_a_stiffness(unit: Unit, blocks) -> None:
    """A standing machine whose speed channel still says 92.3: 40 seeds, no number ever."""
    for seed in range(40):
        rng = np.random.default_rng(seed)
        monitor = UnitMonitor(unit, AnalysisSettings(n_segments=8))
        noise = rng.normal(size=(4, SEGMENT + 7 * HOP)) + np.array([[2000], [2000], [0], [0]])
        for assessment in watch(monitor, list(blocks(noise, n_each=600))):
            for name in ("order1_k_eff_xx_n_per_m", "order1_k_eff_yy_n_per_m"):
                assert assessment.readings[name].value is None, (seed, assessment.window)


def test_a_lost_probe_is_never_shown_as_zero_micrometres(monitor: UnitMonitor, blocks) -> None:
    signals = machine_signals(120.0)
    stream = list(blocks(signals))
    lost = signals.shape[1] // 120  # from half way on the x probe is dead
    dead = [
        replace(
            block,
            samples=np.vstack([np.zeros((1, block.n_samples), np.float32), block.samples[1:]]),
            channel_quality=(bad(Reason.SENSOR_FAILURE), *block.channel_quality[1:]),
        )
        if number >= lost
        else block
        for number, block in enumerate(stream)
    ]
    newest = watch(monitor, dead)[-1].readings
    for name in (
        "order1_shaft_x_um_pk",
        "order1_k_eff_xx_n_per_m",
        "gap_x_um",
        "eccentricity_ratio",
    ):
        assert newest[name].value is None
        assert newest[name].quality == bad(Reason.SENSOR_FAILURE)
    assert newest["order1_k_eff_yy_n_per_m"].value == pytest.approx(1.18e9 / 3, rel=2e-3)
    assert newest["order1_bearing_x_um_pk"].value == pytest.approx(20.0, rel=2e-3)


@pytest.mark.parametrize("spoiled", [np.nan, np.inf, -np.inf])
def test_one_nan_does_not_blind_the_other_channels(
    monitor: UnitMonitor, blocks, spoiled: float
) -> None:
    signals = machine_signals(14.0)
    signals[2, 5000] = spoiled
    readings = watch(monitor, list(blocks(signals)))[-1].readings
    assert readings["order1_bearing_x_um_pk"].quality == bad(Reason.NOT_FINITE)
    assert readings["order1_shaft_x_um_pk"].value == pytest.approx(60.0, rel=1e-3)


def test_a_gap_voids_the_segment_it_touches_and_counts_it(monitor: UnitMonitor, blocks) -> None:
    stream = list(blocks(machine_signals(120.0)))
    kept = stream[:300] + stream[301:]
    results = watch(monitor, kept)
    assert monitor.account.n_gap == 60
    assert [gap.n_samples for gap in monitor.drain_gaps()] == [60]
    assert monitor.drain_gaps() == []
    assert results[-1].window.n_voided == 1
    starts = [a.window.stop_index - SEGMENT for a in results]
    assert starts[0] == 0
    assert starts[1] == HOP
    assert starts[2] == 301 * 60
    assert results[-1].readings["order1_shaft_x_um_pk"].value == pytest.approx(60.0, rel=1e-3)


def test_a_long_outage_leaves_no_old_segments_in_the_average(unit: Unit, blocks) -> None:
    monitor = UnitMonitor(unit, AnalysisSettings(n_segments=4))
    before = list(blocks(machine_signals(60.0)))
    after = list(blocks(machine_signals(14.0), first_index=10**6))
    newest = watch(monitor, [*before, *after])[-1]
    assert newest.window.n_segments == 1
    assert newest.window.first_index == 10**6
    assert newest.window.coverage == 0.25


def test_a_restarted_device_starts_a_new_average(monitor: UnitMonitor, blocks) -> None:
    before = list(blocks(machine_signals(60.0)))
    after = list(blocks(machine_signals(14.0), epoch=2))
    newest = watch(monitor, [*before, *after])[-1]
    assert (newest.window.epoch, newest.window.n_segments, newest.window.coverage) == (2, 1, 1.0)
    assert monitor.account.n_restarts == 1


def test_a_standing_machine_has_no_orders(monitor: UnitMonitor, blocks) -> None:
    newest = watch(monitor, list(blocks(machine_signals(14.0), speed_rpm=0.0)))[-1]
    assert newest.readings["speed_rpm"].quality == bad(Reason.STANDSTILL)
    assert newest.readings["order1_k_eff_xx_n_per_m"].quality == bad(Reason.STANDSTILL)
    assert newest.readings["gap_x_um"].value is not None
    assert newest.orbit is None


def test_without_a_speed_channel_the_line_itself_gives_the_speed(
    monitor: UnitMonitor, blocks
) -> None:
    newest = watch(monitor, list(blocks(machine_signals(60.0), speed_rpm=None)))[-1]
    assert newest.speed_source is SpeedSource.LINE
    assert newest.readings["speed_rpm"].value == pytest.approx(92.3, rel=2e-3)
    assert newest.readings["order1_shaft_x_um_pk"].value == pytest.approx(60.0, rel=3e-3)
    assert newest.readings["order1_shaft_x_um_pk"].quality.reason is Reason.SPEED_UNKNOWN


def test_the_orbit_is_the_newest_turns_of_the_shaft(monitor: UnitMonitor, blocks) -> None:
    orbit = watch(monitor, list(blocks(machine_signals(14.0))))[-1].orbit
    assert orbit is not None
    assert orbit.shaft_x_um.size == round(3 * 60 / 92.3 * RATE_HZ)
    stop = SEGMENT
    turn = 2 * np.pi * 92.3 / 60 * np.arange(stop - orbit.shaft_x_um.size, stop) / RATE_HZ
    np.testing.assert_allclose(orbit.shaft_x_um, 60 * np.cos(turn), atol=1.5)
    np.testing.assert_allclose(orbit.shaft_y_um, 60 * np.sin(turn), atol=1.5)


def test_foreign_blocks_are_refused_naming_both(monitor: UnitMonitor, blocks) -> None:
    block = next(blocks(machine_signals(1.0)))
    with pytest.raises(ValueError, match="'U2' in the monitor of 'U1'"):
        monitor.ingest(replace(block, unit="U2"))
    with pytest.raises(ValueError, match=r"1000\.0 Hz, configured 600\.0 Hz"):
        monitor.ingest(replace(block, rate_hz=1000.0))


def test_few_or_lost_segments_make_a_result_uncertain(unit: Unit, blocks) -> None:
    monitor = UnitMonitor(unit, AnalysisSettings())
    results = watch(monitor, list(blocks(machine_signals(60.0))))
    reasons = [a.readings["order1_k_eff_xx_n_per_m"].quality.reason for a in results]
    assert reasons == [Reason.FEW_SEGMENTS] * 3 + [Reason.OK]


def test_what_was_refused_is_missing_too_and_is_recorded_as_a_gap(
    monitor: UnitMonitor, blocks
) -> None:
    first, *others = list(blocks(machine_signals(14.0)))[:4]
    late = replace(others[-1], rejected=(Rejection("torn", 7),))
    for block in (first, late):
        monitor.ingest(block)

    n_missing = late.first_index - first.stop_index
    assert monitor.drain_gaps() == [Gap(late.epoch, first.stop_index, n_missing, late.start_ns)]
    assert monitor.account.n_gap == n_missing - 7
    assert monitor.account.rejected == {"torn": 7}
