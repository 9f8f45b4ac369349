"""The same recording by every way: the same samples and the same assessments, to the last bit.

The simulated DAQ is a process of its own, as it is for `padwatch replay`.
"""

import asyncio
import dataclasses
import hashlib
from collections.abc import Iterator, Mapping
from contextlib import aclosing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.clock import SystemClock
from acquisition.source import SampleSource
from core.blocks import SampleBlock
from core.quality import GOOD, Reading
from service.cli.daq_process import daq_process
from service.replay import PlayedOut
from service.settings.loading import load_plant_file
from service.settings.plant import PlantFile
from service.settings.units import UnitSettings
from service.wires import Wire, over_wire
from service.wiring.recordings import recording_of, replay_source
from service.wiring.sources import monitor_of, source_of

RECORDINGS = Path(__file__).parents[1] / "recordings"
PLANT_FILE = RECORDINGS / "plant.toml"
RUNS = {"U1": RECORDINGS / "part_load", "U2": RECORDINGS / "full_load"}
OF_THE_HOST = {"clock", "sampled_s"}
"""What a block says of when it has come, not of what it is."""

pytestmark = pytest.mark.long


class Digest:
    """A hash of all that is in a value, to the last bit."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()

    def add(self, value: Any) -> None:
        self._hash.update(type(value).__name__.encode())
        if dataclasses.is_dataclass(value):
            for field in dataclasses.fields(value):
                if field.name not in OF_THE_HOST:
                    self.add((field.name, getattr(value, field.name)))
        elif isinstance(value, np.ndarray):
            self._hash.update(f"{value.dtype} {value.shape}".encode() + value.tobytes())
        elif isinstance(value, Mapping):
            self.add(sorted(value.items()))
        elif isinstance(value, list | tuple):
            for part in value:
                self.add(part)
        else:
            self._hash.update(repr(value).encode())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Digest) and self.hex == other.hex

    def __hash__(self) -> int:
        return hash(self.hex)

    @property
    def hex(self) -> str:
        return self._hash.hexdigest()


@dataclasses.dataclass
class Played:
    """What came of a recording."""

    samples: Digest
    blocks: Digest
    assessments: Digest
    n_samples: int = 0
    n_assessments: int = 0


async def played(source: SampleSource, unit: UnitSettings, plant: PlantFile) -> Played:
    found, monitor = Played(Digest(), Digest(), Digest()), monitor_of(unit, plant.analysis)
    async with source.connect() as blocks, aclosing(blocks):
        async for block in blocks:
            found.samples.add(block.samples)
            found.blocks.add(block)
            found.n_samples += block.n_samples
            for assessment in monitor.ingest(block):
                found.assessments.add(assessment)
                found.n_assessments += 1
    return found


async def straight(speed: float | None = None) -> dict[str, Played]:
    plant = load_plant_file(PLANT_FILE)
    return {
        unit.id: await played(replay_source(RUNS[unit.id], unit, SystemClock(), speed), unit, plant)
        for unit in plant.unit
    }


@contextmanager
def behind(wire: Wire, speed: float) -> Iterator[dict[str, tuple[SampleSource, UnitSettings]]]:
    """Sources of all units behind a DAQ that plays their recordings."""
    arguments = [str(PLANT_FILE), "--through", wire.value, "--speed", str(speed)]
    for folder in RUNS.values():
        arguments += ["--recording", str(folder)]
    with daq_process(arguments) as daq:
        plant = daq.attached(over_wire(load_plant_file(PLANT_FILE), wire))
        yield {
            unit.id: (PlayedOut(source_of(unit, SystemClock()), daq.over[unit.id]), unit)
            for unit in plant.unit
        }


@pytest.mark.parametrize("wire", list(Wire))
async def test_every_wire_brings_the_bits_that_are_in_the_file(wire: Wire) -> None:
    plant, direct = load_plant_file(PLANT_FILE), await straight()
    with behind(wire, speed=0.0) as sources:
        runs = [played(source, unit, plant) for source, unit in sources.values()]
        wired = dict(zip(sources, await asyncio.gather(*runs), strict=True))
    for unit, folder in RUNS.items():
        assert wired[unit].n_samples == recording_of(folder).manifest.n_samples
        assert wired[unit].n_assessments > 0
        assert wired[unit].samples.hex == direct[unit].samples.hex
        assert wired[unit] == direct[unit]


def test_a_digest_sees_the_last_bit_and_not_when_a_block_has_come() -> None:
    def of(value: float, **others: Any) -> str:
        samples, digest = np.full((1, 3), value, dtype=np.float32), Digest()
        digest.add(SampleBlock("U1", 1, 0, 0, 600.0, samples, (GOOD,), **others))
        return digest.hex

    assert of(1.0) == of(1.0, sampled_s=5.0)
    assert of(1.0) != of(float(np.nextafter(np.float32(1.0), np.float32(2.0))))
    assert of(1.0) != of(1.0, slow={"speed": Reading(1.0)})
