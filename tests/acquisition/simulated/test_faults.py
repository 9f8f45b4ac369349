from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from acquisition.errors import ConfigError
from acquisition.simulated.faults import Fault, FaultInjector, FaultKind
from acquisition.simulated.scenario import ChannelScenario, Scenario
from acquisition.simulated.unit import SimulatedUnit
from core.arrays import CountArray

BuildUnit = Callable[..., SimulatedUnit]
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
def test_a_dead_channel_gives_nothing_and_a_stuck_one_its_last_value_but_for_one_count(
    start: int,
) -> None:
    assert not spoiled(FaultKind.DEAD, start)[start:].any()
    counts = spoiled(FaultKind.STUCK, start, pieces=10)
    last = counts[start - 1] if start else 1000
    assert set(counts[start:] - last) == {-1, 0, 1}


def test_a_clipped_channel_loses_its_upper_half_and_a_loose_contact_hits_both_rails() -> None:
    clipped, loose = (spoiled(k)[START:] for k in (FaultKind.CLIPPED, FaultKind.RAIL_HITS))
    assert 0.2 < np.mean(clipped == 32767) < 0.8
    assert clipped.min() > 31_000
    assert [(loose == rail).sum() for rail in (32767, -32768)] == [5, 5]


@pytest.mark.parametrize("kind", FaultKind)
def test_a_fault_begins_with_its_sample_whatever_pieces_are_asked_for(
    build_unit: BuildUnit, full_load: Scenario, kind: FaultKind
) -> None:
    faulty = replace(full_load, channels={"UJB_ux": ChannelScenario(faults=(Fault(kind, START),))})
    healthy = build_unit(full_load).advance(9000).counts
    whole = build_unit(faulty).advance(9000).counts
    unit = build_unit(faulty)
    pieces = [unit.advance(n).counts for n in (1, 2500, 499, 1, 5999)]

    assert np.array_equal(np.concatenate(pieces, axis=1), whole)
    assert np.array_equal(whole[1:], healthy[1:])
    assert np.array_equal(whole[0, :START], healthy[0, :START])
    assert not np.array_equal(whole[0, START:], healthy[0, START:])


def test_swapped_cables_carry_each_other_s_signal(
    build_unit: BuildUnit, full_load: Scenario
) -> None:
    right = build_unit(full_load).advance(3000).counts
    swapped = build_unit(replace(full_load, exchanged=(("UJB_ux", "UJB_uy"),))).advance(3000).counts

    assert np.array_equal(swapped[[1, 0, *range(2, 12)]], right)


def test_faults_of_channels_that_are_not_there_are_refused(
    build_unit: BuildUnit, full_load: Scenario
) -> None:
    with pytest.raises(ConfigError, match="has no channel UJB_uz"):
        build_unit(replace(full_load, channels={"UJB_uz": ChannelScenario()}))
    with pytest.raises(ConfigError, match=r"has no channels .'UJB_ux', 'UJB_uz'. to be exchanged"):
        build_unit(replace(full_load, exchanged=(("UJB_ux", "UJB_uz"),)))
    with pytest.raises(ConfigError, match=r"cannot be exchanged: 20.0 V and 10.0 V"):
        build_unit(replace(full_load, exchanged=(("UJB_ux", "UJB_vx"),)))
