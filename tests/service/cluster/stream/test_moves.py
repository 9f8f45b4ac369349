"""Wherever the analysis of a unit is cut off, and however often: to the last bit the same results.

What is on the stream is as bad as it comes: gaps of all lengths, devices that count anew, lost
links, blocks that overlap or come twice, messages that nobody understands, restarts that nobody
told, impossible blocks.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from harness.ledger_plant import LedgerPlant
from harness.moving_unit import Message, MovingUnit
from harness.stream_rig import found_in
from rigs.blocks import given_block, of_unit, starting_at

from core.arrays import FloatArray, SampleArray
from core.quality import GOOD, Quality, Reading, Reason, bad, uncertain
from core.samples.axis import RECOUNTED_EPOCHS
from core.samples.blocks import Rejection, SampleBlock
from core.samples.calibration import UNLIMITED
from core.units import NS_PER_S
from service.cluster.frames import encoded_block, encoded_link
from service.live.status import LinkState
from service.measuring.acquirer import LinkNews
from service.settings.units import UnitSettings

LEDGER = LedgerPlant(n_units=1, load=1.0, segment_samples=1024, n_segments=3)
SPAN = LEDGER.n_segments * LEDGER.hop_samples
T0 = 1_767_225_600 * NS_PER_S
N_SAMPLES = 240
N_MESSAGES = 100
MakeUnit = Callable[[str], MovingUnit]
TURN_HZ = 10.0


class Device:
    """A shaft whose speed and vortex drift, with spells beyond the limit and all that goes wrong.

    Parameters
    ----------
    unit
        Gives its channels.
    """

    def __init__(self, unit: UnitSettings, seed: int) -> None:
        self._unit, self._rng = unit, np.random.default_rng(seed)
        self._shaft = np.array(["shaft" in channel.id for channel in unit.channel])
        self._epoch, self._next, self._begin_ns = 3, 0, T0

    def block(self) -> SampleBlock:
        """The next one."""
        self._stumble()
        index = self._next + np.arange(N_SAMPLES)
        self._next += N_SAMPLES
        t_s = index / self._unit.sampling_hz
        seconds = t_s[0] + (self._begin_ns - T0) / NS_PER_S
        turn_hz = TURN_HZ * (1.0 + 0.01 * np.sin(seconds / 9.0))
        vortex_hz = turn_hz * (0.29 + 0.05 * np.sin(seconds / 7.0))
        return given_block(
            unit=self._unit.id,
            epoch=self._epoch,
            first_index=int(index[0]),
            start_ns=self._begin_ns + round(float(t_s[0]) * NS_PER_S),
            rate_hz=self._unit.sampling_hz,
            samples=self._samples(t_s, turn_hz, vortex_hz, 160.0 if seconds % 31 > 20 else 40.0),
            channel_quality=tuple(self._quality() for _ in self._shaft),
            slow={
                channel.id: Reading(60.0 * turn_hz if channel.id == "speed" else 45.0)
                for channel in self._unit.slow_channel
            },
        )

    def _stumble(self) -> None:
        kind = self._rng.random()
        if kind < 0.04:
            self._next += int(self._rng.choice([1, 100, 2000, SPAN - 1, SPAN, SPAN + 1]))
        elif kind < 0.06:
            self._next += int(self._rng.choice([2 * SPAN, 2 * SPAN + 100, 10 * SPAN]))
        elif kind < 0.08:
            self._next = max(0, self._next - int(self._rng.choice([1, 100, N_SAMPLES])))
        elif kind < 0.10:
            self._begin_ns += round((self._next / self._unit.sampling_hz + 3.0) * NS_PER_S)
            self._epoch += int(kind < 0.09)  # the others are not told
            self._next = int(self._rng.choice([0, 7]))

    def _samples(
        self, t_s: FloatArray, turn_hz: float, vortex_hz: float, size_um: float
    ) -> SampleArray:
        phase = np.arange(self._shaft.size)[:, np.newaxis] * np.pi / 2
        size = np.where(self._shaft, size_um, 2.0)[:, np.newaxis]
        turning = size * np.cos(2 * np.pi * turn_hz * t_s - phase)
        vortex = 0.3 * size * np.cos(2 * np.pi * vortex_hz * t_s - phase)
        noise = self._rng.normal(0.0, 0.5, turning.shape)
        mean = np.where(self._shaft, 2000.0, 0.0)[:, np.newaxis]
        found: SampleArray = (turning + vortex + noise + mean).astype(np.float32)
        return found

    def _quality(self) -> Quality:
        kind = self._rng.random()
        if kind < 0.002:
            return bad(Reason.SENSOR_FAILURE)
        return uncertain(Reason.CLIPPED) if kind < 0.004 else GOOD


def messages(unit: MovingUnit, seed: int) -> Iterator[Message]:
    """All that is on the stream of a unit; numbers in between are other units'."""
    rng, device = np.random.default_rng(seed + 1000), Device(unit.plant.unit[0], seed)
    sequence = int(rng.integers(1, 9))
    for _ in range(N_MESSAGES):
        sequence += int(rng.integers(1, 4))
        kind = rng.random()
        if kind < 0.02:
            yield sequence, b"nothing that anybody understands"
        elif kind < 0.06:
            state = LinkState.NOT_CONNECTED if kind < 0.04 else LinkState.CONNECTED
            yield sequence, encoded_link(LinkNews("U1", state, "as it happens"), unit.identity)
        else:
            payload = encoded_block(device.block(), unit.identity, T0)
            yield sequence, payload
            if kind > 0.97:
                sequence += 1
                yield sequence, payload


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
async def test_results_are_the_same_wherever_and_however_often_it_is_cut_off(moving_unit, seed):
    rng = np.random.default_rng(seed)
    whole, moved = moving_unit("whole"), moving_unit("moved")
    sent = list(messages(whole, seed))
    await whole.live(sent, None, rng)
    for _ in range(8):
        await moved.live(sent, int(rng.integers(1, 50)), rng)
    await moved.live(sent, None, rng)
    found, wanted = found_in(moved.database), found_in(whole.database)
    for name, rows in wanted.items():
        assert found[name] == rows, name
    assert len(wanted["assessment"]) > 30
    assert max(row["epoch"] for row in wanted["assessment"]) >= RECOUNTED_EPOCHS
    assert wanted["gap"]


class SteadyDevice(Device):
    """One with which nothing goes wrong unless it is asked to."""

    def _stumble(self) -> None:
        """Keep going."""

    def _quality(self) -> Quality:
        return GOOD

    def skip(self, n_samples: int) -> None:
        """Measure so many samples that nobody fetches."""
        self._next += n_samples

    def restart(self) -> None:
        """Be off for three seconds, and count anew."""
        self._begin_ns += round((self._next / self._unit.sampling_hz + 3.0) * NS_PER_S)
        self._epoch, self._next = self._epoch + 1, 0


def sent_by(device: Device, unit: MovingUnit, n: int, first: int) -> list[Message]:
    return [
        (first + number, encoded_block(device.block(), unit.identity, T0)) for number in range(n)
    ]


async def lived_until_its_blocks_have_gone(unit: MovingUnit, device: Device) -> Message:
    """Analyse some blocks and a word on the link, which is all that stays on the stream."""
    told = encoded_link(LinkNews("U1", LinkState.NOT_CONNECTED, "silent"), unit.identity)
    word = (61, told)
    await unit.live([*sent_by(device, unit, 60, 1), word], None, np.random.default_rng(1))
    return word


Steady = tuple[MovingUnit, SteadyDevice]


@pytest.fixture
def steady(moving_unit: MakeUnit) -> Steady:
    """A unit, and its device."""
    unit = moving_unit("plant")
    return unit, SteadyDevice(unit.plant.unit[0], 1)


async def test_what_was_missed_while_all_blocks_went_by_age_is_a_gap(steady):
    unit, device = steady
    word = await lived_until_its_blocks_have_gone(unit, device)
    device.skip(5 * SPAN)

    await unit.live([word, *sent_by(device, unit, 60, 62)], None, np.random.default_rng(1))

    found = found_in(unit.database)
    (gap,) = found["gap"]
    before = [row for row in found["assessment"] if row["stop_index"] <= gap["first_index"]]
    after = [row for row in found["assessment"] if row not in before]
    assert gap["first_index"] == max(row["stop_index"] for row in before)
    assert gap["first_index"] + gap["n_samples"] == 60 * N_SAMPLES + 5 * SPAN
    assert len(after) > 10


async def test_a_device_that_counts_anew_after_all_blocks_went_is_analysed_at_once(steady):
    unit, device = steady
    word = await lived_until_its_blocks_have_gone(unit, device)
    device.restart()

    await unit.live([word, *sent_by(device, unit, 60, 62)], None, np.random.default_rng(1))

    found = found_in(unit.database)
    anew = [row for row in found["assessment"] if row["epoch"] == 4]
    assert min(row["stop_index"] for row in anew) <= SPAN
    assert found["gap"]


async def test_a_stream_that_lost_its_end_is_not_analysed_a_second_time(steady):
    unit, device = steady
    sent = sent_by(device, unit, 60, 101)
    await unit.live(sent, None, np.random.default_rng(1))
    first = found_in(unit.database)["assessment"]

    # of what was confirmed the last are gone, and of what is left the first, by age
    left = [(sequence - 100, payload) for sequence, payload in sent[7:50]]
    device.skip(SPAN)
    await unit.live([*left, *sent_by(device, unit, 20, 51)], None, np.random.default_rng(1))

    found = found_in(unit.database)
    reach = max(row["stop_index"] for row in first)
    assert [row for row in found["assessment"] if row["stop_index"] <= reach] == first
    assert len(found["assessment"]) > len(first)
    (gap,) = found["gap"]
    assert gap["first_index"] + gap["n_samples"] == 60 * N_SAMPLES + SPAN


def blocks(unit: MovingUnit) -> list[SampleBlock]:
    device = SteadyDevice(unit.plant.unit[0], 1)
    return [device.block() for _ in range(30)]


def numbered(unit: MovingUnit, sent: Iterable[SampleBlock]) -> list[Message]:
    return [(n + 1, encoded_block(block, unit.identity, T0)) for n, block in enumerate(sent)]


async def test_blocks_that_come_again_late_with_their_old_time_are_dropped(moving_unit, rng):
    clean, late = moving_unit("clean"), moving_unit("late")
    once = blocks(clean)
    await clean.live(numbered(clean, once), None, rng)
    torn = replace(once[3], rejected=(Rejection("torn", 7),))
    await late.live(numbered(late, [*once[:20], *once[:10], torn, *once[20:]]), None, rng)
    assert found_in(late.database)["assessment"] == found_in(clean.database)["assessment"]
    assert found_in(late.database)["gap"] == found_in(clean.database)["gap"]


async def test_blocks_that_no_device_can_have_given_are_refused_harmlessly(moving_unit, rng):
    clean, spoilt = moving_unit("clean"), moving_unit("spoilt")
    once = blocks(clean)
    await clean.live(numbered(clean, once), None, rng)
    one = once[10]
    wrong = [
        replace(one, counts=one.counts[:, :0]),
        of_unit(one, channels=(replace(UNLIMITED, unit_per_v=np.inf),) * len(one.counts)),
        given_block("U1", 3, 0, T0, one.rate_hz, one.counts[1:], one.channel_quality[1:]),
        of_unit(one, rate_hz=2 * one.rate_hz),
        replace(one, rejected=(Rejection("torn", -5),)),
        replace(one, elsewhere={"speed": Reading(float("inf"))}),
        replace(one, first_index=2**60),
        starting_at(one, 2**63 - 1),
    ]
    refused = await spoilt.live(numbered(spoilt, [*once[:10], *wrong, *once[10:]]), None, rng)
    assert refused == Counter({"impossible": 4, "misfit": 2, "not_understood": 2})
    assert found_in(spoilt.database)["assessment"] == found_in(clean.database)["assessment"]


async def test_a_block_that_says_nothing_of_a_slow_channel_is_analysed_without_it(moving_unit, rng):
    unit = moving_unit("unit")
    sent = blocks(unit)
    sent = [*sent[:15], *(replace(block, elsewhere={}) for block in sent[15:])]
    assert not await unit.live(numbered(unit, sent), None, rng)
    assert found_in(unit.database)["assessment"]
