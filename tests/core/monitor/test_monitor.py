"""The unit monitor: from sample blocks to assessments, and what it refuses to say."""

import gc
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from rigs.blocks import of_unit, with_quality
from rigs.tiers import first_fast

from core.machine.unit import Unit
from core.monitor.assessment import AnalysisSettings, Assessment
from core.monitor.monitor import UnitMonitor
from core.quality import Level, Reason, bad, missing, uncertain
from core.samples.blocks import UNCOUNTED_LOSS, Rejection, SampleBlock, joined
from core.samples.gaps import Gap
from core.spectra.speed import SpeedSource

RATE_HZ = 600.0
HOP, SEGMENT = 7168, 8192


def watch(monitor: UnitMonitor, stream: Sequence[SampleBlock]) -> list[Assessment]:
    return [assessment for block in stream for assessment in monitor.steps(block)]


@pytest.fixture
def monitor(unit: Unit) -> UnitMonitor:
    return UnitMonitor(unit, AnalysisSettings())


GAPS_UM = (1950.0, 2060.0)


@pytest.mark.long
def test_results_come_with_each_hop_however_the_samples_are_cut(monitor, blocks, signals, results):
    rows, counts, single = signals(60.0), [], []
    for block in blocks(rows, n_each=1):
        if found := list(monitor.steps(block)):
            counts.append(block.stop_index)
            single += found
    assert counts == [SEGMENT + n * HOP for n in range(4)]
    for n_each in (60, 8191, 100_000):
        other = results(rows, n_each=n_each)
        assert [a.readings for a in other] == [a.readings for a in single]
        # block times are whole nanoseconds, so the cut moves a time by one at the most
        assert [a.time_ns for a in other] == pytest.approx([a.time_ns for a in single], abs=1)


def test_late_blocks_of_whole_cells_change_no_time(unit, blocks, signals):
    cells = list(blocks(signals(51.0), n_each=7750))
    times_ns = [
        [found.time_ns for found in watch(UnitMonitor(unit, AnalysisSettings()), stream)]
        for stream in (cells, [joined(cells)])
    ]
    assert times_ns[0] == times_ns[1]


def test_the_machine_reads_its_stiffness_its_position_and_its_orbit(results, signals):
    *few, newest = results(signals(60.0, gaps_um=GAPS_UM))
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
    reasons = [a.readings["order1_k_eff_xx_n_per_m"].quality.reason for a in (*few, newest)]
    assert reasons == [Reason.FEW_SEGMENTS] * 3 + [Reason.OK]
    orbit = results(signals(14.0))[-1].orbit
    assert orbit is not None
    n = orbit.shaft_x_um.size
    assert n == round(3 * 60 / 92.3 * RATE_HZ)
    turn = 2 * np.pi * 92.3 / 60 * np.arange(SEGMENT - n, SEGMENT) / RATE_HZ
    np.testing.assert_allclose(orbit.shaft_x_um, 60 * np.cos(turn), atol=1.5)
    np.testing.assert_allclose(orbit.shaft_y_um, 60 * np.sin(turn), atol=1.5)


def test_samples_of_a_result_go_at_once_without_a_search_for_cycles(monitor, blocks, signals):
    """The arrays of one evaluation are a megabyte: twenty units fill 60 MiB between searches."""
    stream = list(blocks(signals(40.0)))
    gc.collect()
    gc.disable()
    try:
        assert len(watch(monitor, stream)) == 3
        assert gc.collect() == 0
    finally:
        gc.enable()


def test_a_vortex_off_its_nominal_order_is_found_and_read_true(results, signals):
    rows = signals(90.0)
    rope = 2 * np.pi * 0.283 * 92.3 / 60 * np.arange(rows.shape[1]) / RATE_HZ
    rows[0] -= 68.0 * np.cos(rope)
    rows[2] += 17.0 * np.cos(rope)
    newest = results(rows)[-1].readings
    assert newest["vortex_frequency_hz"].value == pytest.approx(0.283 * 92.3 / 60, rel=0.01)
    assert newest["vortex_shaft_x_um_pk"].value == pytest.approx(68.0, rel=0.01)
    assert newest["vortex_k_eff_xx_n_per_m"].value == pytest.approx(1.18e9 / 4, rel=0.01)


@pytest.mark.parametrize("coherent_um", [0.0, 2.0], ids=["noise alone", "hydraulic noise"])
def test_without_a_vortex_there_is_no_vortex_quantity(results, signals, coherent_um):
    """Full load: hydraulic noise moves shaft and bearing together at every frequency."""
    rows = signals(90.0, noise_um=1.0)
    common = coherent_um * np.random.default_rng(8).normal(size=rows.shape[1])
    found = results(rows + np.array([[-3.0], [-3.0], [1.0], [1.0]]) * common)
    for number, assessment in enumerate(found):
        reason = Reason.FEW_SEGMENTS if number < 3 else Reason.NO_VORTEX
        of_vortex = {q: r for q, r in assessment.readings.items() if q.startswith("vortex_")}
        assert set(of_vortex.values()) == {missing(reason)}
    assert found[-1].readings["order1_k_eff_xx_n_per_m"].value is not None


def test_a_few_segments_give_no_preferred_stiffness(results, signals):
    """One segment makes any noise coherent."""
    found = results(signals(90.0))
    for axes in ("xx", "yy"):
        preferred = [a.readings[f"stiffness_{axes}_n_per_m"] for a in found]
        assert preferred[:3] == [missing(Reason.FEW_SEGMENTS)] * 3
        assert preferred[3].value == pytest.approx(1.18e9 / 3, rel=0.01)
        assert [a.estimators[axes] for a in found[:3]] == [None] * 3


@pytest.mark.parametrize("order", [0.16, 0.47])
def test_a_line_beside_the_vortex_band_is_told_and_is_no_vortex(results, signals, order):
    rows = signals(90.0, noise_um=1.0)
    rope = 2 * np.pi * order * 92.3 / 60 * np.arange(rows.shape[1]) / RATE_HZ
    rows[0] -= 30.0 * np.cos(rope)
    rows[2] += 10.0 * np.cos(rope)
    newest = results(rows)[-1].readings
    frequency = newest["vortex_frequency_hz"]
    assert frequency.value == pytest.approx(order * 92.3 / 60, rel=0.01)
    assert frequency.quality == uncertain(Reason.OUTSIDE_BAND)
    for name in ("vortex_shaft_x_um_pk", "vortex_k_eff_xx_n_per_m", "vortex_roundness"):
        assert newest[name] == missing(Reason.OUTSIDE_BAND)


@pytest.mark.parametrize("n_seeds", first_fast(1, [8, 100]))
def test_transducer_noise_alone_never_makes_a_stiffness(results, n_seeds):
    """A standing machine whose speed channel still says 92.3."""
    for seed in range(n_seeds):
        rng = np.random.default_rng(seed)
        noise = rng.normal(size=(4, SEGMENT + 7 * HOP)) + np.array([[2000], [2000], [0], [0]])
        for assessment in results(noise, settings=AnalysisSettings(n_segments=8), n_each=600):
            for name in ("order1_k_eff_xx_n_per_m", "order1_k_eff_yy_n_per_m"):
                assert assessment.readings[name].value is None, (seed, assessment.window)


@pytest.mark.parametrize("spoiled", [np.nan, np.inf, -np.inf])
def test_one_nan_does_not_blind_the_other_channels(results, signals, spoiled):
    rows = signals(14.0)
    rows[2, 5000] = spoiled
    readings = results(rows)[-1].readings
    assert readings["order1_bearing_x_um_pk"].quality == bad(Reason.NOT_FINITE)
    assert readings["order1_shaft_x_um_pk"].value == pytest.approx(60.0, rel=1e-3)


def test_a_standing_machine_has_no_orders_and_the_line_gives_an_unmeasured_speed(results, signals):
    newest = results(signals(14.0), speed_rpm=0.0)[-1]
    assert newest.readings["speed_rpm"].quality == bad(Reason.STANDSTILL)
    assert newest.readings["order1_k_eff_xx_n_per_m"].quality == bad(Reason.STANDSTILL)
    assert newest.readings["gap_x_um"].value is not None
    assert newest.orbit is None
    newest = results(signals(60.0), speed_rpm=None)[-1]
    assert newest.speed_source is SpeedSource.LINE
    assert newest.readings["speed_rpm"].value == pytest.approx(92.3, rel=2e-3)
    assert newest.readings["order1_shaft_x_um_pk"].value == pytest.approx(60.0, rel=3e-3)
    assert newest.readings["order1_shaft_x_um_pk"].quality.reason is Reason.SPEED_UNKNOWN


def test_what_came_before_an_outage_or_a_restart_is_in_no_average_after_it(unit, blocks, signals):
    before = list(blocks(signals(60.0)))
    for anew, restarts in (({"first_index": 10**6}, 0), ({"epoch": 2}, 1)):
        monitor = UnitMonitor(unit, AnalysisSettings(n_segments=4))
        window = watch(monitor, [*before, *blocks(signals(14.0), **anew)])[-1].window
        expected = {"epoch": 1, "first_index": 0, "n_segments": 1} | anew
        assert {name: getattr(window, name) for name in expected} == expected
        assert window.coverage == (1.0 if restarts else 0.25)
        assert monitor.account.n_restarts == restarts


def test_a_lost_probe_is_never_shown_as_zero_micrometres(monitor, blocks, signals):
    rows = signals(120.0)
    stream = list(blocks(rows))
    lost = rows.shape[1] // 120  # from half way on the x probe is dead
    dead = [
        with_quality(
            replace(block, counts=block.counts * (np.arange(4) > 0)[:, np.newaxis]),
            (bad(Reason.SENSOR_FAILURE), *block.channel_quality[1:]),
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


def test_a_gap_voids_the_segment_it_touches_and_counts_it(monitor, blocks, signals):
    stream = list(blocks(signals(120.0)))
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


def test_foreign_blocks_are_refused_naming_both(monitor, blocks, signals):
    block = next(blocks(signals(1.0)))
    with pytest.raises(ValueError, match="unit 'U1', got 'U2'"):
        list(monitor.steps(of_unit(block, unit="U2")))
    with pytest.raises(ValueError, match=r"at 600\.0 Hz, got 1000\.0 Hz"):
        list(monitor.steps(of_unit(block, rate_hz=1000.0)))


@pytest.mark.parametrize(("reason", "is_estimated"), [("torn", False), (UNCOUNTED_LOSS, True)])
def test_refused_samples_are_recorded_as_a_gap(monitor, blocks, signals, reason, is_estimated):
    first, *others = list(blocks(signals(14.0)))[:4]
    late = replace(others[-1], rejected=(Rejection(reason, 7),))
    for block in (first, late):
        list(monitor.steps(block))

    n_missing = late.first_index - first.stop_index
    gap = Gap(late.epoch, first.stop_index, n_missing, late.start_ns, is_estimated=is_estimated)
    assert monitor.drain_gaps() == [gap]
    assert monitor.account.n_gap == n_missing - 7
    assert monitor.account.rejected == {reason: 7}
