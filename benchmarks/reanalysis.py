"""What analysing a recording again costs: seconds of recording per second of one core.

``python benchmarks/reanalysis.py`` records an hour of the demonstration's first unit, twelve
channels at 600 Hz, and a day that repeats it, and gives each to ``padwatch reanalyse`` in a process
of its own. Processor time counts that process, its start, and the confined child that reads the
recording. Ends with 1 below 3,000 times real time for the day.
"""

import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from acquisition.clock import SystemClock
from acquisition.delivery.blocks import BlockAssembler
from acquisition.recordings.reader import open_recording
from acquisition.recordings.reading import close_idle_children
from acquisition.recordings.writer import RecordingWriter
from core.units import ns_from_s
from service.measuring.simulated_sources import simulated_feed
from service.settings.adapter_values import recorded_unit
from service.settings.core_values import calibration_of
from service.settings.plant import load_plant_file

PLANT = Path(__file__).parents[1] / "deploy" / "demo.toml"
SECONDS = 3600.0
N_HOURS = 24
REQUIRED_RATIO = 3000.0


def record(folder: Path) -> None:
    """Record an hour as fast as it can be simulated."""
    unit = load_plant_file(PLANT).unit[0]
    feed = simulated_feed(unit, SystemClock())
    delivery = BlockAssembler(calibration_of(unit))
    with RecordingWriter(folder, recorded_unit(unit), "benchmark") as writer:
        for _ in range(round(SECONDS * unit.rate_hz / unit.block_samples)):
            for block in delivery.take([feed.advance(unit.block_samples)]):
                writer.write(block)


def repeat(hour: Path, folder: Path) -> None:
    """Record an hour again and again, with indices and times that go on."""
    unit, recording = load_plant_file(PLANT).unit[0], open_recording(hour)
    n_samples, length_ns = round(SECONDS * unit.rate_hz), ns_from_s(SECONDS)
    with RecordingWriter(folder, recorded_unit(unit), "benchmark") as writer:
        for number in range(N_HOURS):
            for run in recording.blocks():
                side = replace(run.side, start_ns=run.side.start_ns + number * length_ns)
                first_index = run.first_index + number * n_samples
                writer.write(replace(run, first_index=first_index, side=side))


def analyse(folder: Path, seconds: float) -> float:
    """Analyse a recording again, print what it took, and return how fast that was."""
    command = [sys.executable, "-m", "service.cli.main", "reanalyse", str(folder)]
    before, start_s = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    subprocess.run([*command, "--plant", str(PLANT)], check=True, stdout=subprocess.DEVNULL)
    wall_s = time.monotonic() - start_s
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    print(f"{seconds / 3600:g} h, newest results: {wall_s:.2f} s, {used_s:.2f} s of one core")
    print(f"  {seconds / used_s:.0f} times real time per core")
    return seconds / used_s


def main() -> int:
    """Record, analyse again, and print what it took."""
    with tempfile.TemporaryDirectory() as root:
        hour, day = Path(root) / "hour", Path(root) / "day"
        record(hour)
        repeat(hour, day)
        close_idle_children()
        analyse(hour, SECONDS)
        ratio = analyse(day, N_HOURS * SECONDS)
    print(f"  required of the day {REQUIRED_RATIO:.0f}")
    return 0 if ratio >= REQUIRED_RATIO else 1


if __name__ == "__main__":
    sys.exit(main())
