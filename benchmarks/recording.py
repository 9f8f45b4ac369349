"""What continuous recording costs: processor time and room of a unit of the example plant.

``python benchmarks/recording.py`` records twenty minutes of the simulated plant, twelve channels at
600 Hz, as fast as it can, with the part of the service that does it: blocks are found again as
counts, parts are written and synced every 30 s, and joined every ten minutes.
"""

import os
import tempfile
import time
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.delivery.blocks import BlockAssembler
from core.samples.blocks import SampleBlock
from service.measuring.simulated_sources import simulated_feed
from service.recordings.continuous_recorder import UnitRecorder
from service.recordings.segment import SegmentSettings, join
from service.settings.adapter_values import recorded_unit
from service.settings.core_values import calibration_of
from service.settings.plant import load_plant_file
from service.settings.units import UnitSettings

PLANT = Path(__file__).parents[1] / "deploy" / "demo.toml"
SECONDS = 1200.0
S_PER_DAY = 86_400.0


def blocks_of(unit: UnitSettings) -> list[SampleBlock]:
    """Twenty minutes, beginning with an hour so that they are two whole stretches."""
    feed, delivery = simulated_feed(unit, FullHour()), BlockAssembler(calibration_of(unit))
    n_slots = round(SECONDS * unit.rate_hz / unit.block_samples)
    return [
        block for _ in range(n_slots) for block in delivery.take([feed.advance(unit.block_samples)])
    ]


class FullHour(SystemClock):
    """Samples begin with the year 2026."""

    def now_ns(self) -> int:
        """Midnight."""
        return 1_767_225_600 * 10**9


def main() -> None:
    """Record, and print what it took."""
    unit = load_plant_file(PLANT).unit[0]
    blocks = blocks_of(unit)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        tape = UnitRecorder(root, recorded_unit(unit), SegmentSettings())
        start_s, join_s, write_bytes = time.process_time(), 0.0, _written()
        for block in blocks:
            tape.write(block, 0.0)
            join_s += _join(tape)
        tape.end()
        join_s += _join(tape)
        took_s, write_bytes = time.process_time() - start_s, _written() - write_bytes
        n_bytes = sum(path.stat().st_size for path in root.glob("*/*"))
    per_day = S_PER_DAY / SECONDS / 1e6
    print(f"{len(unit.channel)} channels at {unit.rate_hz:g} Hz, {SECONDS / 60:g} min")
    share, joining = 100 * took_s / SECONDS, 100 * join_s / SECONDS
    print(f"  of one core     {share:.2f} %, of which joining {joining:.2f} %")
    print(f"  kept            {per_day * n_bytes:.0f} MB a day")
    print(f"  written in all  {per_day * write_bytes:.0f} MB a day")


def _join(tape: UnitRecorder) -> float:
    start_s = time.process_time()
    for folder in tape.ended:
        join(folder)
    tape.ended.clear()
    return time.process_time() - start_s


def _written() -> int:
    """Bytes that this process has handed to the disk so far; 0 where Linux does not say."""
    path = Path(f"/proc/{os.getpid()}/io")
    if not path.exists():
        return 0
    fields = dict(line.split(": ") for line in path.read_text().splitlines())
    return int(fields["wchar"])


if __name__ == "__main__":
    main()
