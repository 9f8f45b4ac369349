"""What analysing a recording again costs: seconds of recording per second of one core.

``python benchmarks/reanalysis.py`` records an hour of the demonstration's first unit, twelve
channels at 600 Hz, and gives it to ``padwatch reanalyse`` in a process of its own. Processor time
counts that process and the confined child that reads the recording.
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.delivery.blocks import BlockAssembler
from acquisition.recordings.writer import RecordingWriter
from service.measuring.simulated_sources import simulated_feed
from service.settings.adapter_values import recorded_unit
from service.settings.core_values import calibration_of
from service.settings.loading import load_plant_file

PLANT = Path(__file__).parents[1] / "deploy" / "demo.toml"
SECONDS = 3600.0


def record(folder: Path) -> None:
    """Record an hour as fast as it can be simulated."""
    unit = load_plant_file(PLANT).unit[0]
    feed = simulated_feed(unit, SystemClock())
    delivery = BlockAssembler(calibration_of(unit))
    with RecordingWriter(folder, recorded_unit(unit), "benchmark") as writer:
        for _ in range(round(SECONDS * unit.rate_hz / unit.block_samples)):
            for block in delivery.take(feed.advance(unit.block_samples)):
                writer.write_block(block)


def main() -> None:
    """Record, analyse again, and print what it took."""
    with tempfile.TemporaryDirectory() as root:
        folder = Path(root) / "hour"
        record(folder)
        command = [sys.executable, "-m", "service.cli.main", "reanalyse", str(folder)]
        start_s = time.monotonic()
        subprocess.run(
            [*command, "--plant", str(PLANT)],
            check=True,
            stdout=subprocess.DEVNULL,
        )
        wall_s = time.monotonic() - start_s
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    used_s = used.ru_utime + used.ru_stime
    print(f"{SECONDS / 60:g} min, newest results: {wall_s:.2f} s, {used_s:.2f} s of one core")
    print(f"  {SECONDS / used_s:.0f} times real time per core")


if __name__ == "__main__":
    main()
