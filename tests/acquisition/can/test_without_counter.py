"""A device that counts nothing: the clock finds what is missing, and nothing false is joined."""

import itertools

import numpy as np
import pytest
from rigs.tiers import covering, first_fast

from acquisition.can.assembly import FrameAssembler
from acquisition.can.settings import CanSettings, CanSlowChannel
from acquisition.errors import ConfigError

RATE_HZ = 600.0
NS_PER_S = 1_000_000_000
START_NS = 1_767_225_600 * NS_PER_S
IDS = (0x220, 0x221, 0x222)
STATUS = 0x230
DBC = "".join(
    [
        'VERSION ""\nBU_: N\n',
        *(
            f"BO_ {frame_id} M{n}: 8 N\n"
            + "".join(f' SG_ s{c} : {16 * c}|16@1- (1,0) [0|0] "V" N\n' for c in range(4))
            for n, frame_id in enumerate(IDS)
        ),
        f"BO_ {STATUS} STATUS: 8 N\n",
        ' SG_ t : 0|16@1- (0.1,0) [0|0] "degC" N\n SG_ ok : 16|16@1+ (1,0) [0|0] "" N\n',
        ' SG_ run : 32|16@1+ (1,0) [0|0] "" N\n',
    ]
)


@pytest.fixture
def settings(settings_of) -> CanSettings:
    return settings_of(
        DBC,
        {f"c{n}": f"M{n // 4}.s{n % 4}" for n in range(12)},
        slow=(CanSlowChannel("oil", "degC", "STATUS.t"),),
        ok_bits="STATUS.ok",
        epoch="STATUS.run",
        hold_s=2.0,
    )


@pytest.fixture
def assembler(settings, assembler_by) -> FrameAssembler:
    return assembler_by(settings)


def instant(number: int):
    """Three frames of four channels; channel c of sample n is n + c."""
    for n, frame_id in enumerate(IDS):
        samples = (number + 4 * n + np.arange(4)) % 2**15
        yield frame_id, samples.astype("<i2").tobytes()


def status(temperature: float = 45.0, ok: int = 0xFFF, run: int = 1):
    words = (round(temperature * 10), ok, run, 0)
    return STATUS, b"".join(word.to_bytes(2, "little") for word in words)


def at(second: float) -> int:
    return START_NS + round(second * NS_PER_S)


def run(assembler, first: int, stop: int, step: int = 6, late_s: float = 0.0):
    """Instants as they pass, in batches, each arriving when its last sample is there."""
    blocks = []
    for start in range(first, stop, step):
        frames = itertools.chain.from_iterable(instant(n) for n in range(start, start + step))
        blocks += assembler.take(frames, at((start + step) / RATE_HZ + late_s))
    return blocks


def assert_true_samples(blocks) -> None:
    """Every column is one instant's: no two instants are ever mixed."""
    for block in blocks:
        first = block.counts[0].astype(int)
        for c, samples in enumerate(block.counts):
            np.testing.assert_array_equal(samples, (first + c) % 2**15)


def assert_never_joined_over_a_loss(blocks) -> None:
    """Where the index goes on by one, so does the plant."""
    axis = np.concatenate([np.arange(b.first_index, b.stop_index) for b in blocks])
    plant = np.concatenate([b.counts[0] for b in blocks]).astype(int)
    steps = np.diff(plant) % 2**15
    assert (steps[np.diff(axis) == 1] == 1).all()


@pytest.mark.parametrize("n_lost", [1, 7, 600, 36_000])
def test_a_loss_is_found_by_the_clock_flagged_and_counted(n_lost, assembler):
    blocks = run(assembler, 0, 1200)
    blocks += run(assembler, 1200 + n_lost, 3600 + n_lost)
    assert_true_samples(blocks)
    assert_never_joined_over_a_loss(blocks)
    rejected = [r for b in blocks for r in b.rejected]
    assert {r.reason for r in rejected} == {"uncounted_loss"}
    assert blocks[-1].stop_index == 3600 + n_lost
    n_stored = sum(b.n_samples for b in blocks)
    assert n_stored + sum(r.n_samples for r in rejected) == 3600 + n_lost
    assert len(blocks) > 400


def nothing_at_all(_number: int):
    return []


def two_sets_that_lose_one(number: int):
    """Of two sets in a row the end of one and the beginning of the other are lost."""
    first, second = list(instant(number)), list(instant(number + 1))
    return [*first[:2], *second[2:]]


@pytest.mark.parametrize(
    ("rate_hz", "what_is_left"),
    covering(
        first_fast(2, [1250.0, 100.0, 500.0, 600.0, 625.0, 1000.0]),
        [nothing_at_all, two_sets_that_lose_one],
    ),
)
def test_one_lost_instant_is_found_at_every_rate(rate_hz, what_is_left, settings, assembler_by):
    """Also where what is left of two instants looks like one: they are never mixed."""
    assembler = assembler_by(settings, rate_hz)
    n_seen = 2 if what_is_left is two_sets_that_lose_one else 1
    blocks, number = [], 0
    while number < 8_000:
        frames = [f for n in range(number, number + 6) for f in instant(n)]
        number += 6
        if number % 3000 == 0:
            frames += what_is_left(number)
            number += n_seen
        blocks += assembler.take(frames, at(number / rate_hz))
    assert_true_samples(blocks)
    assert_never_joined_over_a_loss(blocks)
    n_stored = sum(b.n_samples for b in blocks)
    assert n_stored + sum(r.n_samples for b in blocks for r in b.rejected) == blocks[-1].stop_index
    assert {r.reason for b in blocks for r in b.rejected} == {"uncounted_loss"}


def test_a_rate_at_which_the_clock_cannot_tell_losses_is_refused(settings, assembler_by):
    with pytest.raises(ConfigError, match=r"counters: list .* above 1250 .* got 1251"):
        assembler_by(settings, 1251.0)


@pytest.mark.parametrize("share", [1.3, 2.0])
def test_more_samples_than_the_rate_as_from_two_modules_are_not_believed(share, assembler):
    blocks = []
    for start in range(0, 3000, 6):
        frames = itertools.chain.from_iterable(instant(n) for n in range(start, start + 6))
        if not assembler.trouble:
            blocks += assembler.take(frames, at((start + 6) / RATE_HZ / share))
    assert "frames arrive faster than rate_hz" in assembler.trouble
    assert sum(b.n_samples for b in blocks) <= 0.8 * share * RATE_HZ


@pytest.mark.parametrize("step_s", [-3600.0, -2.0, 2.0, 3600.0])
def test_a_host_clock_that_is_set_and_frames_that_had_waited_are_not_too_many(step_s, assembler):
    frames = itertools.chain.from_iterable(instant(n) for n in range(1200))
    assembler.take(frames, at(2.0))  # they waited before the bus was opened
    for start in range(1200, 6000, 6):
        frames = itertools.chain.from_iterable(instant(n) for n in range(start, start + 6))
        assembler.take(frames, at((start + 6) / RATE_HZ + (step_s if start > 3000 else 0.0)))
        assert assembler.trouble == ""


def test_late_frames_are_no_loss(assembler):
    random = np.random.default_rng(4)
    blocks = []
    for start in range(0, 12_000, 30):
        blocks += run(assembler, start, start + 30, 30, float(random.exponential(0.003)))
    blocks += run(assembler, 12_000, 12_600, 600, 0.0)
    assert blocks[-1].stop_index == 12_600
    assert all(b.rejected == () for b in blocks)


@pytest.mark.parametrize("lost", [0, 1, 2])
def test_a_set_with_a_frame_missing_is_dropped_whole_and_counted(lost, assembler):
    frames = [list(instant(n)) for n in range(30)]
    for n in (5, 6, 20):
        del frames[n][lost]
    blocks = assembler.take(itertools.chain.from_iterable(frames), at(0.05))
    assert_true_samples(blocks)
    assert [(b.first_index, b.stop_index) for b in blocks] == [(0, 5), (7, 20), (21, 30)]
    assert [sum(r.n_samples for r in b.rejected) for b in blocks] == [0, 2, 1]
    assert {r.reason for b in blocks for r in b.rejected} == {"incomplete_frames"}


def test_a_duplicate_and_a_frame_out_of_turn_spoil_their_set_only(assembler):
    a, b, c = (list(instant(n)) for n in range(3))
    frames = [*a, b[0], b[1], b[1], b[2], *c]
    blocks = assembler.take(frames, at(0.0))
    assert_true_samples(blocks)
    assert blocks[0].first_index == 0
    assert blocks[-1].counts[0][-1] == 2


def test_status_without_counter_holds_from_its_arrival_for_a_while_and_no_longer(assembler):
    blocks = assembler.take([status(45.0)], at(0.0))
    blocks += run(assembler, 0, 600)
    blocks += assembler.take([status(50.0, ok=0xFFE)], at(1.0))
    blocks += run(assembler, 600, 3000)
    assert [b.n_samples for b in blocks] == [6] * 500
    assert_true_samples(blocks)
    by_start = {b.first_index: b for b in blocks}
    assert by_start[0].side.ok.all()
    assert by_start[0].side.slow.tolist() == [[45.0]]
    assert by_start[594].side.ok[0]
    assert by_start[600].side.slow.tolist() == [[50.0]]
    assert by_start[600].side.ok[:, 0].tolist() == [False, *[True] * 11]
    assert by_start[1794].side.slow.tolist() == [[50.0]]
    assert np.isnan(by_start[1800].side.slow[0])
    assert not by_start[1800].side.ok.any()


def test_a_told_restart_begins_a_new_epoch_at_zero(assembler):
    blocks = assembler.take([status(run=1)], at(0.0)) + run(assembler, 0, 600)
    blocks += assembler.take([status(run=2)], at(1.0)) + run(assembler, 600, 1200)
    assert {b.epoch for b in blocks} == {1, 2}
    second = [b for b in blocks if b.epoch == 2]
    assert (second[0].first_index, second[-1].stop_index) == (0, 600)
    assert second[0].side.slow.tolist() == [[45.0]]
