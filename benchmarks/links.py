"""Links that fail and return: when the service notices, and when samples are here again.

The simulated DAQ is a process of its own. One is stopped and continued, so that the connection
stays but nobody answers; a hundred in one process are started while the service looks for them.
Times are counted in poll periods, since seconds depend on the plant file.
"""

import argparse
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ingest import daq, fetch, padwatch, plant_file

POLL_S = 0.25
"""The default of a block ring's ``poll_period_s``."""

LOOK_S = 0.01
NOTICE_LIMIT, RETURN_LIMIT = 3.0, 2.0
START_UP_S = 3.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=20)
    parser.add_argument("--devices", type=int, default=100)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        single = silences(Path(folder), options.cycles)
        many = vanish_together(Path(folder), options.devices)
    print(f"{'in poll periods of ' + str(POLL_S) + ' s':<44}{'median':>8}{'worst':>8}{'limit':>8}")
    rows = (
        ("silent DAQ noticed", single["noticed"], NOTICE_LIMIT),
        ("first good sample after it answers again", single["back"], RETURN_LIMIT),
    )
    for words, values, limit in rows:
        print(f"{words:<44}{statistics.median(values):>8.2f}{max(values):>8.2f}{limit:>8.1f}")
    print(f"{options.devices} devices that return together, last one back after {many:.2f} periods")
    sys.exit(any(max(values) > limit for _, values, limit in rows))


def silences(folder: Path, n_cycles: int) -> dict[str, list[float]]:
    """Let one DAQ fall silent and answer again, many times."""
    plant = folder / "one.toml"
    plant.write_text(plant_file(1, folder / "one"), encoding="utf-8")
    found: dict[str, list[float]] = {"noticed": [], "back": []}
    with padwatch("daq", str(plant)) as (process, line):
        port = int(line.partition('"port": ')[2].rstrip("}\n "))
        plant.write_text(plant_file(1, folder / "one", {"U1": port}), encoding="utf-8")
        with padwatch("run", str(plant), "--port", "0") as (_, said):
            units = said.split()[-1] + "api/v1/units"
            until(units, "connected")
            for _ in range(n_cycles):
                time.sleep(1.0)
                found["noticed"].append(
                    after_signal(process, signal.SIGSTOP, units, "not_connected")
                )
                time.sleep(1.0)
                found["back"].append(after_signal(process, signal.SIGCONT, units, "connected"))
    return found


def after_signal(process: subprocess.Popen[str], number: int, units: str, state: str) -> float:
    """Poll periods from a signal to the DAQ until all units are in this state."""
    process.send_signal(number)
    started = time.monotonic()
    until(units, state)
    return (time.monotonic() - started) / POLL_S


def until(units: str, state: str) -> None:
    while any(unit["source"]["state"] != state for unit in fetch(units)):
        time.sleep(LOOK_S)


def vanish_together(folder: Path, n_devices: int) -> float:
    """Poll periods until the last of many devices is back, after all of them listen again."""
    plant = folder / "many.toml"
    plant.write_text(plant_file(n_devices, folder / "many"), encoding="utf-8")
    with daq(plant) as ports:
        text = plant_file(n_devices, folder / "many", ports)
    plant.write_text(text, encoding="utf-8")
    with padwatch("run", str(plant), "--port", "0") as (_, said):
        units = said.split()[-1] + "api/v1/units"
        until(units, "not_connected")
        time.sleep(START_UP_S)
        with daq(plant):
            started = time.monotonic()
            until(units, "connected")
            return (time.monotonic() - started) / POLL_S


if __name__ == "__main__":
    main()
