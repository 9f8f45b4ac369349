"""Amplitudes of a rack give equation (5), phases and uncertainty what they add; no more is said."""

from dataclasses import replace

import numpy as np
import pytest
from rigs.blocks import of_unit, with_quality
from rigs.racks import AMPLITUDES, GAPS, K_B, PHASES, RATE_HZ, SLOW, VORTEX, blocks_of, polls, watch

from core.alarms.rules import LimitRule, UnitRules, rule_of
from core.alarms.unit_alarms import UnitAlarms
from core.limits import Limits
from core.machine.channel import Channel, Measurand
from core.machine.unit import BearingAccuracy
from core.monitor.assessment import AnalysisSettings
from core.monitor.catalogue import CATALOGUE
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD, Level, Reading, Reason, bad, missing
from core.samples.blocks import SampleBlock
from core.spectra.polls import PollSettings, PollTransform, VectorPart, VectorRow
from core.spectra.segments import Evidence
from core.spectra.speed import SpeedSource
from core.stiffness.stiffness_budget import BEARING_GAIN, BRACKET, COHERENCE, SPREAD
from core.uncertainty import SHAFT_GAIN


def test_equation_5_is_computed_from_the_amplitudes_of_a_rack(rack):
    newest = watch(rack(), polls(60.0, 50.0, 20.0, 10.0, noise=1e-6))[-1]

    value = {name: reading.value for name, reading in newest.readings.items()}
    assert value["order1_shaft_x_um_pk"] == pytest.approx(60.0, rel=1e-5)
    assert value["order1_bearing_y_um_pk"] == pytest.approx(10.0, rel=1e-5)
    assert value["order1_k_eff_xx_n_per_m"] == pytest.approx(20.0 / 60.0 * K_B, rel=1e-5)
    assert value["order1_k_eff_yy_n_per_m"] == pytest.approx(10.0 / 50.0 * K_B, rel=1e-5)
    assert newest.readings["stiffness_xx_n_per_m"] == newest.readings["order1_k_eff_xx_n_per_m"]
    assert newest.estimators == {"xx": "ratio_order1", "yy": "ratio_order1"}
    assert newest.evidence is Evidence.AMPLITUDE_ONLY
    assert newest.quality == GOOD
    assert newest.speed_source is SpeedSource.SLOW_CHANNEL
    assert newest.readings["order1_frequency_hz"].u_systematic == pytest.approx(
        0.02 * 92.3 / 60 / 3**0.5
    )
    assert (value["speed_rpm"], value["power_mw"], value["oil_temperature_c"]) == (92.3, 650, 45)


def test_what_takes_waveforms_is_missing_and_never_a_number(rack):
    newest = watch(rack(), polls(60.0, 50.0, 20.0, 10.0))[-1]

    assert set(newest.readings) == {quantity.name for quantity in CATALOGUE}
    absent = [
        name
        for name in newest.readings
        if name.startswith(("dynamic_", "vortex_shaft", "vortex_k", "vortex_transfer"))
        or any(word in name for word in ("coherence", "roundness", "transfer", "gap", "centre"))
    ]
    assert len(absent) > 30
    for name in absent:
        assert newest.readings[name] == missing(Reason.NOT_MEASURED), name
    assert newest.orbit is None
    assert newest.spectrum.frequency_hz.size == 0
    assert not newest.spectrum.n_segments.any()


def test_velocity_and_acceleration_become_displacement_at_the_speed_of_the_poll(unit):
    omega = 2 * np.pi * 92.3 / 60
    channels = (
        *unit.channels[:2],
        Channel("bx", Measurand.VELOCITY_MM_S),
        Channel("by", Measurand.ACCELERATION_M_S2),
    )
    unit, settings = replace(unit, rate_hz=RATE_HZ, channels=channels), AnalysisSettings()
    monitor = UnitMonitor(unit, settings, PollTransform(unit, AMPLITUDES, settings))
    newest = watch(monitor, polls(60, 60, 20e-3 * omega, 20e-6 * omega**2, noise=0.0, n=12))[-1]

    assert newest.readings["order1_bearing_x_um_pk"].value == pytest.approx(20.0, rel=1e-5)
    assert newest.readings["order1_bearing_y_um_pk"].value == pytest.approx(20.0, rel=1e-5)


@pytest.mark.parametrize(
    ("amplitudes", "changes", "reason"),
    [
        ((0.0, 60.0, 20.0, 20.0), {}, Reason.INSUFFICIENT_EXCITATION),
        ((60.0, 60.0, 20.0, 20.0), {"runout_um_pk": 20.0}, Reason.INSUFFICIENT_EXCITATION),
        ((60.0, 60.0, 2.0, 20.0), {"runout_um_pk": 14.0}, Reason.OK),
    ],
)
def test_too_little_motion_gives_no_stiffness(rack, amplitudes, changes, reason):
    newest = watch(rack(bearing=changes), polls(*amplitudes))[-1]

    k_eff = newest.readings["order1_k_eff_xx_n_per_m"]
    assert k_eff.quality.reason is reason
    assert (k_eff.value is None) == (reason is not Reason.OK)
    assert newest.readings["stiffness_xx_n_per_m"].quality.reason is reason


def test_a_lost_probe_is_never_shown_as_a_number_and_a_flagged_one_enters_no_average(rack):
    monitor = rack()
    watch(monitor, polls(60.0, 50.0, 20.0, 10.0, n=48))
    lost = {0: bad(Reason.SENSOR_FAILURE)}
    newest = watch(monitor, polls(60.0, 50.0, 20.0, 10.0, n=12, first_index=48, quality=lost))[-1]

    for name in ("order1_shaft_x_um_pk", "order1_k_eff_xx_n_per_m", "stiffness_xx_n_per_m"):
        assert newest.readings[name] == missing(Reason.SENSOR_FAILURE)
    assert newest.readings["order1_k_eff_yy_n_per_m"].value is not None
    assert newest.quality.level is Level.BAD

    monitor = rack()
    watch(monitor, polls(60.0, 50.0, 20.0, 10.0, n=40, noise=0.0))
    wrong = {0: bad(Reason.CLIPPED)}
    watch(monitor, polls(9e9, 50.0, 20.0, 10.0, n=8, noise=0.0, first_index=40, quality=wrong))
    newest = watch(monitor, polls(60.0, 50.0, 20.0, 10.0, n=12, noise=0.0, first_index=48))[-1]

    assert newest.readings["order1_shaft_x_um_pk"].value == pytest.approx(60.0)
    assert newest.window.n_segments == 52
    assert newest.window.coverage == pytest.approx(52 / 60)


def test_a_standing_machine_gives_nothing_and_one_without_a_speed_the_rated_one_in_doubt(rack):
    standing = SLOW | {"speed": Reading(3.0)}
    newest = watch(rack(), polls(60.0, 50.0, 20.0, 10.0, slow=standing))[-1].readings

    for name in ("speed_rpm", "order1_shaft_x_um_pk", "stiffness_xx_n_per_m"):
        assert newest[name] == missing(Reason.STANDSTILL)

    unknown = SLOW | {"speed": missing(Reason.NOT_MEASURED)}
    newest = watch(rack(), polls(60.0, 50.0, 20.0, 10.0, slow=unknown))[-1]

    assert newest.speed_source is SpeedSource.RATED
    assert newest.readings["order1_k_eff_xx_n_per_m"].quality.level is Level.UNCERTAIN


def test_gaps_give_the_shaft_centre_which_moves_with_a_new_reference_alone(rack):
    stream = polls(60.0, 50.0, 20.0, 10.0, 1970.0, 1960.0, noise=1e-6)
    newest = watch(rack(AMPLITUDES + GAPS), stream)[-1]

    assert newest.readings["gap_x_um"].value == pytest.approx(1970.0, rel=1e-4)
    assert newest.readings["shaft_centre_x_um"].value == pytest.approx(30.0, abs=0.1)
    assert newest.readings["eccentricity_ratio"].value == pytest.approx(0.25, abs=0.001)

    monitor = rack(AMPLITUDES + GAPS)
    stream = polls(60.0, 50.0, 20.0, 10.0, 1970.0, 1960.0, n=24, noise=0.0)
    before = watch(monitor, stream[:12])[-1]
    [bearing] = monitor.unit.bearings
    moved = replace(bearing, gap_reference_um=(1970.0, 1960.0))
    monitor.replace_description(replace(monitor.unit, bearings=(moved,)))
    after = watch(monitor, stream[12:])[-1]

    assert before.readings["eccentricity_ratio"].value == pytest.approx(0.25)
    assert after.readings["eccentricity_ratio"].value == pytest.approx(0.0)
    with pytest.raises(ValueError, match="rated_speed_rpm is 100"):
        monitor.replace_description(replace(monitor.unit, rated_speed_rpm=100.0))


def test_the_vortex_order_is_its_own_line_or_switched_off(rack):
    monitor = rack(AMPLITUDES + VORTEX, bearing={"runout_um_pk": 100.0})
    newest = watch(monitor, polls(60.0, 50.0, 20.0, 10.0, 30.0, 30.0, 12.0, 12.0))[-1]

    quiet = Reason.INSUFFICIENT_EXCITATION
    assert newest.readings["order1_k_eff_xx_n_per_m"].quality.reason is quiet
    assert newest.readings["vortex_k_eff_xx_n_per_m"].value == pytest.approx(0.4 * K_B, rel=0.02)
    assert newest.readings["vortex_frequency_hz"].value == pytest.approx(0.25 * 92.3 / 60)
    assert newest.estimators["xx"] == "ratio_vortex"

    newest = watch(rack(has_vortex=False), polls(60.0, 50.0, 20.0, 10.0))[-1]

    assert newest.readings["vortex_k_eff_xx_n_per_m"] == missing(Reason.SWITCHED_OFF)
    assert newest.readings["vortex_shaft_x_um_pk"] == missing(Reason.SWITCHED_OFF)


def test_a_block_of_something_else_is_refused(rack):
    [block] = polls(60.0, 50.0, 20.0, 10.0, n=1)
    with pytest.raises(ValueError, match="block of unit 'U1', got 'U2'"):
        list(rack().steps(of_unit(block, unit="U2")))
    with pytest.raises(ValueError, match=r"at 0\.2 Hz, got 1\.0 Hz"):
        list(rack().steps(of_unit(block, rate_hz=1.0)))
    with pytest.raises(ValueError, match="6 channels, got 4"):
        list(rack(AMPLITUDES + GAPS).steps(block))
    with pytest.raises(ValueError, match="has no channel"):
        rack((VectorRow("nowhere", VectorPart.GAP),))
    with pytest.raises(ValueError, match="rows must be unique"):
        rack((AMPLITUDES[0], AMPLITUDES[0]))


@pytest.mark.parametrize("first", range(4), ids="{} polls after a result".format)
@pytest.mark.parametrize("delay_s", [0.0, 10.0])
def test_a_step_of_vibration_is_an_alarm_in_half_a_minute_and_delay(unit, rack, first, delay_s):
    limits = LimitRule(Limits(100.0), rule_of(delay_s, 30.0))
    board = UnitAlarms(unit, UnitRules(bearings={"UJB": {"shaft_order1": limits}}))
    monitor, n_before = rack(averaging=PollSettings()), 40 + first
    values = np.repeat([[60.0], [50.0], [20.0], [10.0]], n_before + 12, axis=1)
    values[0, n_before:] = 120.0
    raised = {
        event.identity.kind: block.stop_ns / 1e9 - n_before / RATE_HZ
        for block in blocks_of(values)
        for told in board.take(block, list(monitor.steps(block)), block.stop_ns)
        for event in told.events
        if event.change == "raised"
    }

    assert set(raised) == {"order1_shaft_x"}
    assert delay_s <= raised["order1_shaft_x"] <= 30.0 + delay_s


@pytest.mark.long
def test_the_stated_random_part_is_true(rack):
    results = [
        watch(rack(), polls(60.0, 60.0, 20.0, 20.0, noise=0.05, seed=seed))[-1].readings
        for seed in range(60)
    ]
    k_eff = [readings["order1_k_eff_xx_n_per_m"] for readings in results]

    found = np.std([reading.value for reading in k_eff])
    stated = np.mean([reading.u_random for reading in k_eff])
    assert found == pytest.approx(stated, rel=0.3)


def test_transducers_bracket_and_the_unknown_coherence_are_the_systematic_part(rack):
    accuracy = BearingAccuracy(shaft_gain=0.03, bearing_gain=0.04, bracket_stiffness=0.1)
    monitor = rack(bearing={"accuracy": accuracy})
    newest = watch(monitor, polls(60.0, 60.0, 20.0, 20.0))[-1]

    budget = newest.budgets["order1_k_eff_xx_n_per_m"]
    share = {line.name: line.contribution / budget.value for line in budget.lines}
    third = 1.0 / np.sqrt(3.0)
    assert share[SHAFT_GAIN] == pytest.approx(0.03 * third)
    assert share[BEARING_GAIN] == pytest.approx(0.04 * third)
    assert share[BRACKET] == pytest.approx(0.1 * third)
    assert share[COHERENCE] == pytest.approx((1 / np.sqrt(0.9) - 1) * third)
    assert share[SPREAD] > 0.0


def test_a_rack_that_repeats_itself_or_is_asked_too_often_is_not_believed_more(rack):
    rng = np.random.default_rng(7)
    measured = np.array([[60.0], [60.0], [20.0], [20.0]]) * (1 + 0.05 * rng.normal(size=(4, 12)))
    often = watch(rack(), blocks_of(np.repeat(measured, 5, axis=1)))[-1]
    once = watch(rack(), blocks_of(measured))[-1]

    name = "order1_k_eff_xx_n_per_m"
    assert often.readings[name].value == pytest.approx(once.readings[name].value)
    assert often.readings[name].u_random == pytest.approx(once.readings[name].u_random, rel=0.05)

    newest = watch(rack(), polls(60.0, 60.0, 20.0, 20.0, noise=0.0))[-1]

    assert newest.readings["order1_k_eff_xx_n_per_m"].quality.reason is Reason.FEW_SEGMENTS


@pytest.mark.long
def test_a_rack_that_averages_longer_than_a_poll_is_not_believed_more(rack):
    """Each poll shows the mean of the last ten periods: neighbours share nine of them."""
    results = []
    for seed in range(60):
        each = np.random.default_rng(seed).normal(size=(4, 69))
        mean = np.array([np.convolve(row, np.full(10, 0.1), "valid") for row in each])
        values = np.array([[60.0], [60.0], [20.0], [20.0]]) * (1 + 0.1 * mean)
        results.append(watch(rack(), blocks_of(values))[-1].readings["order1_k_eff_xx_n_per_m"])

    found = np.std([reading.value for reading in results])
    stated = np.array([reading.u_random for reading in results])
    assert found / 1.5 < np.mean(stated) < 2.5 * found
    truth = 20.0 / 60.0 * K_B
    missed = [abs(r.value - truth) > 2.0 * u for r, u in zip(results, stated, strict=True)]
    assert sum(missed) <= 12


FILM = 0.5e9 + 1j * 0.04e9


def vectors(noise_deg: float = 0.0, n: int = 60) -> list[SampleBlock]:
    """A forward circle of the shaft; the bearing follows through the film: X_b = U·k/k_b."""
    bearing = FILM / K_B * 60.0
    angle = np.rad2deg(np.angle(bearing))
    rows = np.array([60.0, 60.0, abs(bearing), abs(bearing), 40.0, -50.0, 40 + angle, angle - 50])
    rng = np.random.default_rng(3)
    values = np.repeat(rows[:, np.newaxis], n, axis=1)
    values[:4] *= 1 + 0.001 * rng.normal(size=(4, n))
    values[4:] += noise_deg * rng.normal(size=(4, n))
    return blocks_of(values)


def test_with_phases_stiffness_and_damping_are_told_apart(rack):
    newest = watch(rack(AMPLITUDES + PHASES), vectors(noise_deg=0.5))[-1]

    omega = 2 * np.pi * 92.3 / 60
    k = newest.readings["order1_transfer_k_xx_n_per_m"]
    c = newest.readings["order1_transfer_c_yy_n_s_per_m"]
    assert k.value == pytest.approx(FILM.real, rel=2e-3)
    assert c.value * omega == pytest.approx(FILM.imag, rel=0.05)
    assert k.u_random is not None
    assert newest.readings["order1_roundness"].value == pytest.approx(1.0, abs=1e-3)
    assert newest.readings["order1_coherence_xx"] == missing(Reason.NOT_MEASURED)
    assert newest.evidence is Evidence.AMPLITUDE_AND_PHASE
    assert newest.estimators == {"xx": "transfer_order1", "yy": "transfer_order1"}


def test_vectors_that_do_not_hang_together_or_are_exchanged_are_doubted(rack):
    newest = watch(rack(AMPLITUDES + PHASES), vectors(noise_deg=60.0))[-1]

    for name in ("order1_k_eff_xx_n_per_m", "order1_transfer_k_xx_n_per_m"):
        assert newest.readings[name] == missing(Reason.INSUFFICIENT_EXCITATION)

    monitor = rack(AMPLITUDES + PHASES, rotation_sense=-1)
    newest = watch(monitor, vectors())[-1]

    assert newest.readings["stiffness_xx_n_per_m"].quality.reason is Reason.SWAPPED_AXES


def test_a_phase_that_is_bad_is_no_phase(rack):
    blocks = [with_quality(b, (GOOD,) * 6 + (bad(Reason.SENSOR_FAILURE),) * 2) for b in vectors()]
    newest = watch(rack(AMPLITUDES + PHASES), blocks)[-1]

    assert newest.readings["order1_transfer_k_xx_n_per_m"] == missing(Reason.NOT_MEASURED)
    assert newest.readings["order1_k_eff_xx_n_per_m"].value is not None
    assert newest.evidence is Evidence.AMPLITUDE_ONLY
