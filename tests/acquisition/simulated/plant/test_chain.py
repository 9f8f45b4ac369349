"""What the transducers of a simulated unit, and their faults, make of the motion of the machine."""

from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import ConfigError
from acquisition.simulated.plant.faults import Fault, FaultInjector, FaultKind
from acquisition.simulated.plant.plant import SimulatedPlant
from acquisition.simulated.plant.scenario import ChannelScenario, Scenario, TransducerNoise
from core.arrays import CountArray, FloatArray
from core.machine.channel import Channel, Measurand
from core.machine.response import HighPass, Resonance
from core.machine.unit import Unit

UJB = 0
TURN = 400
"""Samples of one turn at 90 r/min."""


def readings(machine: Unit, scenario: Scenario, n_chunks: int = 1) -> FloatArray:
    plant = SimulatedPlant(machine, replace(scenario, speed_rpm=90.0), seed=7)
    return np.concatenate([plant.advance().readings for _ in range(n_chunks)], axis=1)


def line(signal: FloatArray, order: int = 1) -> complex:
    turns = np.arange(TURN * (signal.size // TURN)) / TURN
    return complex(2.0 * np.mean(signal[: turns.size] * np.exp(-2j * np.pi * order * turns)))


def with_bearing(scenario: Scenario, **changes: object) -> Scenario:
    changed = replace(scenario.bearings["UJB"], **changes)  # type: ignore[arg-type]
    return replace(scenario, bearings={**scenario.bearings, "UJB": changed})


@pytest.fixture
def four_probes(machine: Unit) -> Unit:
    """UJB with probes across from its own, as channels 12 and 13."""
    opposite = tuple(Channel(f"UJB_{axis}_far", Measurand.GAP_UM, 1) for axis in "xy")
    bearing = replace(
        machine.bearings[UJB],
        opposite_x="UJB_x_far",
        opposite_y="UJB_y_far",
        opposite_gap_x="UJB_gap_x_far",
        opposite_reference_um=(1900.0, 1950.0),
    )
    return replace(
        machine,
        channels=machine.channels + opposite,
        bearings=(bearing, *machine.bearings[1:]),
    )


def test_an_accelerometer_s_corner_takes_its_share_and_a_probe_s_resonance_no_gap(machine, quiet):
    corner, soft = HighPass(0.5, order=2), Resonance(60.0, 0.05)
    channels = {
        "UJB_vx": ChannelScenario(response=corner),
        "UJB_ux": ChannelScenario(response=soft),
    }
    right, found = (
        readings(machine, scenario, 4) for scenario in (quiet, replace(quiet, channels=channels))
    )

    assert abs(line(found[2]) / line(right[2]) / corner.at(np.array([1.5]))[0] - 1.0) < 1e-3
    difference = found[0] - right[0]
    assert abs(difference[: 5 * TURN].mean()) < 0.05
    assert np.abs(difference).max() < 0.2


def test_runout_passes_each_probe_in_turn_and_shakes_no_bearing(four_probes, quiet):
    rough = with_bearing(quiet, runout_um_pk=(10.0, 4.0j))

    runout = readings(four_probes, rough) - readings(four_probes, quiet)

    x, y, far_x, far_y = (runout[row, : 5 * TURN] for row in (0, 1, 12, 13))
    assert [abs(line(x)), abs(line(x, 2))] == pytest.approx([10.0, 4.0])
    # the surface needs a quarter turn from x to y, and half a turn to the far side
    assert y[100:] == pytest.approx(x[:-100])
    assert far_x[200:] == pytest.approx(x[:-200])
    assert far_y[200:] == pytest.approx(y[:-200])
    assert np.abs(runout[2:12]).max() == 0.0


def test_a_bump_is_a_smaller_gap_and_a_shaft_that_seems_nearer(machine, quiet):
    rough = with_bearing(quiet, runout_um_pk=(10.0,))
    bare = replace(
        machine, channels=(Channel("UJB_ux", Measurand.DISPLACEMENT_UM), *machine.channels[1:])
    )

    gap = readings(machine, rough)[0] - readings(machine, quiet)[0]
    displacement = readings(bare, rough)[0] - readings(bare, quiet)[0]

    # the plant has turned 25.6 times while it warmed up
    turns = 25.6 + np.arange(gap.size) / TURN
    assert gap == pytest.approx(-10.0 * np.cos(2 * np.pi * turns), abs=1e-9)
    assert displacement == pytest.approx(-gap)


def test_runout_of_one_probe_is_motion_along_its_axis_and_nobody_else_sees_it(four_probes, quiet):
    own = {name: ChannelScenario(runout_um_pk=(3.0 - 4.0j,)) for name in ("UJB_uy", "UJB_x_far")}

    seen = readings(four_probes, replace(quiet, channels=own)) - readings(four_probes, quiet)

    rows = {channel.id: row for row, channel in enumerate(four_probes.channels)}
    near, far = (seen[rows.pop(name)] for name in own)
    assert abs(line(near[: 5 * TURN])) == pytest.approx(5.0)
    assert near == pytest.approx(-far)  # one gap shrinks as the other grows
    assert np.abs(seen[list(rows.values())]).max() == 0.0


def test_a_probe_that_drifts_and_a_thermometer_that_errs_tell_what_is_not_there(build_unit, quiet):
    wrong = with_bearing(quiet, position_error_um=(7.0, -3.0), oil_temperature_error_c=0.4)
    right, found = (build_unit(scenario) for scenario in (quiet, wrong))
    told, shown = right.advance(600), found.advance(600)

    counts_per_um = 32768.0 / 20.0 / -250.0
    apart_um = (shown.counts - told.counts.astype(np.float64)).mean(axis=1) / counts_per_um
    assert apart_um[:4] == pytest.approx([-7.0, 3.0, 0.0, 0.0], abs=0.05)
    # speed, power, nothing, then oil and slow gaps of the UJB
    assert np.subtract(shown.side.slow, told.side.slow)[3:6, 0] == pytest.approx([0.4, -7e-3, 3e-3])
    assert found.truth() == right.truth()


def test_a_gain_error_leaves_the_reference_gap_as_it_is(machine, quiet):
    wrong = {"UJB_ux": ChannelScenario(gain=1.05), "UJB_vy": ChannelScenario(gain=0.97)}

    right = readings(machine, quiet)
    found = readings(machine, replace(quiet, channels=wrong))

    assert found[0] - 2000.0 == pytest.approx(1.05 * (right[0] - 2000.0))
    assert found[3] == pytest.approx(0.97 * right[3])
    assert np.array_equal(found[1], right[1])


def test_growth_widens_all_gaps_alike_and_displacement_opposite_ones_inversely(four_probes, quiet):
    grown = with_bearing(quiet, gap_growth_um=70.0)

    mean = readings(four_probes, grown)[:, : 5 * TURN].mean(axis=1)

    # the shaft stands at (60, -80) µm
    assert mean[[0, 1]] == pytest.approx([2000.0 - 60.0 + 70.0, 2100.0 + 80.0 + 70.0], abs=0.01)
    assert mean[[12, 13]] == pytest.approx([1900.0 + 60.0 + 70.0, 1950.0 - 80.0 + 70.0], abs=0.01)


def test_the_growth_of_the_gaps_wanders_and_moves_nothing_else(build_unit, full_load):
    steady = replace(full_load, wander_time_s=60.0)
    wandering = with_bearing(steady, gap_growth_wander_um_rms=20.0)
    one, other = build_unit(wandering), build_unit(steady)
    one.advance(60_000)
    other.advance(60_000)

    assert abs(one.truth().bearings["UJB"].gap_growth_um) > 1.0
    assert one.truth().bearings["UJB"].centre_x_um == other.truth().bearings["UJB"].centre_x_um


def test_noise_of_an_accelerometer_passes_its_own_corner(machine, quiet):
    silent = replace(quiet, unbalance_grade_mm_s=0.0)
    noisy = replace(
        silent,
        noise=TransducerNoise(accelerometer_g_per_sqrt_hz=5e-6),
        channels={"UJB_vx": ChannelScenario(response=HighPass(2.0, order=2))},
    )

    rms = readings(machine, noisy, 60).std(axis=1)

    # the 1/f noise below 2 Hz, integrated, is nearly all there is; probes have none of it
    assert rms[2] < 0.2 * rms[3]
    assert rms[0] < 1e-6


def test_everything_at_once_does_not_depend_on_the_pieces_it_is_asked_for_in(build_unit, part_load):
    rough = with_bearing(
        part_load, runout_um_pk=(10.0, 3.0), gap_growth_um=30.0, gap_growth_wander_um_rms=5.0
    )
    scenario = replace(
        rough,
        speed_wander=0.003,
        noise=TransducerNoise(gap_um_rms=1.2, accelerometer_g_per_sqrt_hz=5e-6),
        channels={
            "UJB_vx": ChannelScenario(HighPass(0.5, order=2), 1.03),
            "LJB_vy": ChannelScenario(HighPass(0.5), faults=(Fault(FaultKind.STUCK, 4000),)),
            "LJB_ux": ChannelScenario(faults=(Fault(FaultKind.CLIPPED, 4000),)),
            "LJB_uy": ChannelScenario(faults=(Fault(FaultKind.RAIL_HITS, 100),)),
        },
        exchanged=(("TJB_ux", "TJB_uy"),),
    )
    pieces = (1, 7, 2041, 2047, 4096, 1000)
    unit, one_piece = build_unit(scenario), build_unit(scenario)
    whole = one_piece.advance(sum(pieces))

    cut = np.concatenate([unit.advance(n).counts for n in pieces], axis=1)

    assert np.array_equal(cut, whole.counts)
    next_slow = [u.advance(n).side.slow for u, n in ((unit, 1), (one_piece, 100))]
    assert next_slow[0] == pytest.approx(next_slow[1], nan_ok=True, rel=0)
    assert not np.array_equal(build_unit(scenario, 2).advance(5000).counts, cut[:, :5000])


START = 3000
"""In the middle of the second chunk."""


def spoiled(kind: FaultKind, start: int = START, pieces: int = 1) -> CountArray:
    swing = np.rint(1000.0 + 500.0 * np.sin(np.arange(12_000) / 50.0)).astype(np.int16)
    counts = np.stack([swing, swing])
    injector = FaultInjector(np.random.default_rng(1), {1: [Fault(kind, start)]})
    for first in range(0, 12_000, 12_000 // pieces):
        injector.spoil(counts[:, first : first + 12_000 // pieces], first)
    assert np.array_equal(counts[0], swing)
    assert np.array_equal(counts[1, :start], swing[:start])
    spoilt: CountArray = counts[1]
    return spoilt


@pytest.mark.parametrize("start", [0, START])
def test_a_dead_channel_gives_nothing_and_a_stuck_one_its_last_value_but_for_one_count(start):
    assert not spoiled(FaultKind.DEAD, start)[start:].any()
    counts = spoiled(FaultKind.STUCK, start, pieces=10)
    last = counts[start - 1] if start else 1000
    assert set(counts[start:] - last) == {-1, 0, 1}


def test_a_clipped_channel_loses_its_upper_half_and_a_loose_contact_hits_both_rails():
    clipped, loose = (spoiled(k)[START:] for k in (FaultKind.CLIPPED, FaultKind.RAIL_HITS))
    assert 0.2 < np.mean(clipped == 32767) < 0.8
    assert clipped.min() > 31_000
    assert [(loose == rail).sum() for rail in (32767, -32768)] == [5, 5]


@pytest.mark.parametrize("kind", FaultKind)
def test_a_fault_begins_with_its_sample_in_its_channel_alone(build_unit, full_load, kind):
    faulty = replace(full_load, channels={"UJB_ux": ChannelScenario(faults=(Fault(kind, START),))})
    healthy = build_unit(full_load).advance(9000).counts
    whole = build_unit(faulty).advance(9000).counts

    assert np.array_equal(whole[1:], healthy[1:])
    assert np.array_equal(whole[0, :START], healthy[0, :START])
    assert not np.array_equal(whole[0, START:], healthy[0, START:])


def test_swapped_cables_carry_each_other_s_signal(build_unit, full_load):
    right = build_unit(full_load).advance(3000).counts
    swapped = build_unit(replace(full_load, exchanged=(("UJB_ux", "UJB_uy"),))).advance(3000).counts

    assert np.array_equal(swapped[[1, 0, *range(2, 12)]], right)


def test_faults_of_channels_that_are_not_there_are_refused(build_unit, full_load):
    with pytest.raises(ConfigError, match="has no channel UJB_uz"):
        build_unit(replace(full_load, channels={"UJB_uz": ChannelScenario()}))
    with pytest.raises(ConfigError, match=r"channels UJB_ux and UJB_uz must both be in unit"):
        build_unit(replace(full_load, exchanged=(("UJB_ux", "UJB_uz"),)))
    with pytest.raises(ConfigError, match=r"cannot be exchanged: .* 20.0 V and 10.0 V"):
        build_unit(replace(full_load, exchanged=(("UJB_ux", "UJB_vx"),)))
