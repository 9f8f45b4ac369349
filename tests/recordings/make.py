"""Makes the recorded runs of this folder and their known results; run it when a format changes.

    .venv/bin/python tests/recordings/make.py

U1 runs at part load; on its way some samples are lost, a probe is doubted by its device for two
seconds, and the device restarts. U2 runs at full load until the cable of a probe breaks.
"""

import argparse
import asyncio
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.delivery.blocks import BlockAssembler
from core.monitor.assessment import Assessment
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.app.recordings import recording_writer, replay_source
from service.cli.offline.reanalysis import refreshes
from service.measuring.simulated_sources import simulated_feed
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.plant import PlantFile, load_plant_file
from service.settings.units import UnitSettings

HERE = Path(__file__).parent
START_NS = 1_767_225_600 * 1_000_000_000
SLOT = 50
PART_LOAD_SLOTS, FULL_LOAD_SLOTS = 720, 480
RESTART_SLOT = 500


class FirstOfJanuary(SystemClock):
    """The runs begin with the year 2026."""

    def now_ns(self) -> int:
        return START_NS


def part_load(unit: UnitSettings) -> Iterator[SampleBlock]:
    """A gap of 25 slots, a probe not OK, a restart."""
    feed = simulated_feed(unit, FirstOfJanuary())
    for number in range(PART_LOAD_SLOTS):
        raw = feed.advance(SLOT)
        if 150 <= number < 175:
            continue
        if 330 <= number < 354:
            raw.side.ok[1] = False
        if number >= RESTART_SLOT:
            first = raw.first_index - RESTART_SLOT * SLOT
            raw = replace(raw, epoch=raw.epoch + 1, first_index=first)
        yield raw


def full_load(unit: UnitSettings) -> Iterator[SampleBlock]:
    """The x probe falls to 0 V after 30 s, through a few wild samples."""
    feed = simulated_feed(unit, FirstOfJanuary())
    for number in range(FULL_LOAD_SLOTS):
        raw = feed.advance(SLOT)
        if number == 360:
            raw.counts[0, ::3] = -32768
        if number > 360:
            raw.counts[0] = 0
        yield raw


RUNS = {"U1": ("part_load", part_load), "U2": ("full_load", full_load)}


def record(unit: UnitSettings) -> Path:
    name, run = RUNS[unit.id]
    folder = HERE / name
    shutil.rmtree(folder, ignore_errors=True)
    delivery = BlockAssembler(calibration_of(unit))
    with recording_writer(unit, folder, "tests/recordings/make.py") as writer:
        for raw in run(unit):
            for block in delivery.take([raw]):
                writer.write(block)
        for block in delivery.flush():
            writer.write(block)
    return folder


async def results(folder: Path, unit: UnitSettings, plant: PlantFile) -> list[Assessment]:
    source = replay_source(folder, unit, SystemClock(), None)
    monitor = UnitMonitor(machine_of(unit), analysis_of(plant.analysis))
    return [found.assessment() async for found in refreshes(source, monitor, lambda _: None)]


def main() -> None:
    argparse.ArgumentParser(description=__doc__).parse_args()
    plant = load_plant_file(HERE / "plant.toml")
    for unit in plant.unit:
        folder = record(unit)
        found = asyncio.run(results(folder, unit, plant))
        known = {
            "time_ns": [a.time_ns for a in found],
            "series": {name: [a.readings[name].value for a in found] for name in found[0].readings},
            "level": {
                name: [a.readings[name].quality.level.name.lower() for a in found]
                for name in found[0].readings
            },
        }
        path = HERE / f"{folder.name}.known.json"
        path.write_text(json.dumps(known, indent=None, separators=(",", ":")) + "\n")
        n_bytes = sum(f.stat().st_size for f in folder.iterdir())
        print(f"{folder.name}: {n_bytes / 1e3:.0f} kB, {len(found)} results")


if __name__ == "__main__":
    main()
