"""`Truth`: samples that anybody can compute from seed, channel, epoch and index, at any time.

Every unit has three bearings with four channels each; a probe's counts hold its gap, 1× of the
shaft, a vortex and noise, a bearing's hold 1×, the vortex and noise. From time to time, by the seed
alone, the shaft shakes too much in one bearing (an exceedance), or a probe is lost.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

BEARINGS = ("UJB", "LJB", "TJB")
N_CHANNELS = 4 * len(BEARINGS)
SPEED_RPM = 600.0
GAP_COUNTS, LOST_COUNTS = 21_845, 40
SHAFT_COUNTS, BEARING_COUNTS = 655, 200
"""1× of the shaft, 60 µm, and of the bearing."""

TIMES = 3.0
"""How much more the shaft shakes in an exceedance: 180 µm, of 110 that raise an alarm."""

STORY_S = 12.0
"""In every so many seconds there is one exceedance, and in every fourth such stretch a probe is
lost."""

GOLDEN, FIRST, SECOND = (
    np.uint64(value) for value in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
Counts = npt.NDArray[np.int16]


def mixed(number: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Spread numbers over all 64 bits (Steele et al. 2014, splitmix64)."""
    with np.errstate(over="ignore"):
        number = (number + np.uint64(1)) * GOLDEN
        number = (number ^ (number >> np.uint64(30))) * FIRST
        number = (number ^ (number >> np.uint64(27))) * SECOND
        return number ^ (number >> np.uint64(31))


def share(*numbers: int) -> float:
    """A number from 0 to 1 that follows from others."""
    key = np.uint64(0)
    for number in numbers:
        key = mixed(np.array([key ^ np.uint64(number & (2**64 - 1))], dtype=np.uint64))[0]
    return float(key >> np.uint64(11)) / 2**53


@dataclass(frozen=True)
class Spell:
    """Something wrong with one bearing, from a sample up to another."""

    kind: str
    bearing: int
    start: int
    stop: int


@dataclass(frozen=True)
class Truth:
    """What one unit's converter delivers in one epoch.

    Parameters
    ----------
    unit
        Number of the unit, from 1.
    """

    seed: int
    unit: int
    rate_hz: float
    epoch: int = 1

    def counts(self, first: int, n: int) -> Counts:
        """(12, n) counts of the converter from a sample on."""
        index = np.arange(first, first + n, dtype=np.int64)
        turn = round(self.rate_hz * 60.0 / SPEED_RPM)
        whirl = 2.0 * np.pi * (index % turn) / turn
        vortex = 2.0 * np.pi * (index % (4 * turn)) / (4 * turn)
        noise = self._noise(index)
        shakes = np.ones((len(BEARINGS), n))
        lost = np.zeros((len(BEARINGS), n), dtype=bool)
        for spell in self.spells(first, first + n):
            where = slice(max(0, spell.start - first), spell.stop - first)
            if spell.kind == "exceedance":
                shakes[spell.bearing, where] = TIMES
            else:
                lost[spell.bearing, where] = True
        rows = []
        for b in range(len(BEARINGS)):
            for axis in (0.0, np.pi / 2.0):
                shaft = SHAFT_COUNTS * shakes[b] * np.cos(whirl - axis)
                shaft += 200.0 * np.cos(vortex - axis)
                rows.append(np.where(lost[b], LOST_COUNTS, GAP_COUNTS + shaft))
            for axis in (0.0, np.pi / 2.0):
                rows.append(
                    BEARING_COUNTS * shakes[b] * np.cos(whirl - axis - 1.2)
                    + 30.0 * np.cos(vortex - axis - 1.0)
                )
        return (np.rint(np.array(rows)) + noise).astype(np.int16)

    def slow(self, slot: int) -> tuple[float, ...]:
        """Speed, power and oil temperatures of a slot, by its number."""
        lively = [share(self.seed, self.unit, self.epoch, 77, slot, n) for n in range(5)]
        plain = (SPEED_RPM, 100.0, 45.0, 46.0, 47.0)
        spread = (0.01, 0.5, 0.1, 0.1, 0.1)
        return tuple(
            float(np.float32(p + s * x)) for p, s, x in zip(plain, spread, lively, strict=True)
        )

    def spells(self, start: int, stop: int) -> Iterator[Spell]:
        """What is wrong between two samples, in order of their beginning."""
        length = round(STORY_S * self.rate_hz)
        for number in range(start // length, (stop - 1) // length + 1):
            for spell in self._story(number, length):
                if spell.start < stop and spell.stop > start:
                    yield spell

    def _story(self, number: int, length: int) -> Iterator[Spell]:
        def part(what: int) -> float:
            return share(self.seed, self.unit, self.epoch, 99, number, what)

        begin, lasts = 0.3 * part(0), 0.02 + 0.6 * part(1)
        first = number * length + round(begin * length)
        yield Spell(
            "exceedance", int(len(BEARINGS) * part(2)), first, first + round(lasts * length)
        )
        if number % 4 == 3:
            first = number * length + round((0.1 + 0.2 * part(3)) * length)
            stop = first + round((0.05 + 0.4 * part(4)) * length)
            yield Spell("lost", int(len(BEARINGS) * part(5)), first, stop)

    def _noise(self, index: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        key = mixed(np.array([self.seed], dtype=np.uint64)) ^ np.uint64(
            (self.unit << 40) ^ (self.epoch << 48)
        )
        keys = mixed(key + np.arange(N_CHANNELS, dtype=np.uint64))
        spread = mixed(keys[:, np.newaxis] ^ index.astype(np.uint64)[np.newaxis, :])
        return (spread >> np.uint64(59)).astype(np.int64) - 16
