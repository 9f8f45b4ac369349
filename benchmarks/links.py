"""Links that fail and return: when the service notices, and when samples are here again.

The simulated DAQ is a process of its own. One is stopped and continued, so that the connection
stays but nobody answers; a hundred in one process are started while the service looks for them.
Times are counted in poll periods, since seconds depend on the plant file; of a CAN bus, that nobody
polls, and of a queue, that is emptied all the time, in those of a lost link's retries.
"""

import argparse
import random
import re
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass
from pathlib import Path

from ingest import daq, fetch, padwatch, plant_file

POLL_S = 0.25
"""The default of a block ring's ``poll_period_s``."""

LOOK_S = 0.01
NOTICE_LIMIT, RETURN_LIMIT = 3.0, 2.0
START_UP_S = 3.0


@dataclass(frozen=True)
class Wire:
    """A source's table in the plant file, ``{folder}`` and ``{port}`` to be filled in.

    Parameters
    ----------
    value
        What the register map says of each channel; None if there is no map.
    """

    source: str
    poll_s: float = POLL_S
    value: str | None = None


SERIAL = 'baudrate = 460800\nparity = "none"\ntimeout_s = 0.1\n'
RTU = 'kind = "modbus_ring"\ndevice = "{folder}/line"\n' + SERIAL
TCP = 'host = "127.0.0.1"\nport = {port}\n'
FIFO = 'kind = "modbus_fifo"\naddresses = [1000]\n' + TCP
POLLED = 'kind = "modbus_polled"\npoll_period_s = 0.1\ntimeout_s = 0.15\n' + TCP
RACK = 'kind = "modbus_vector"\npoll_period_s = 1.0\n' + TCP
VECTOR = 'quantity = "order1_amplitude"\ndetector = "pp"\n'
CAN = 'kind = "can"\ninterface = "slcan"\nprofile = "padwatch_int16"\n'
CAN_TCP = CAN + 'channel = "socket://127.0.0.1:{port}"\n'
CAN_LINE = CAN + 'channel = "{folder}/can"\noptions = {{ sleep_after_open = 0.0 }}\n'
WIRES = {
    "ring, TCP": Wire('kind = "modbus_ring"\n' + TCP),
    "ring, RTU": Wire(RTU),
    "queue, TCP": Wire(FIFO),
    "registers, TCP": Wire(POLLED, poll_s=0.1, value=""),
    "rack, TCP": Wire(RACK, poll_s=1.0, value=VECTOR),
    "CAN, TCP": Wire(CAN_TCP, poll_s=0.5),
    "CAN FD, TCP": Wire(CAN_TCP + "fd = true\n", poll_s=0.5),
    "CAN, line": Wire(CAN_LINE, poll_s=0.5),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=20)
    parser.add_argument("--devices", type=int, default=100)
    parser.add_argument("--wires", nargs="*", choices=list(WIRES), default=list(WIRES))
    options = parser.parse_args()
    rows = []
    print(f"{'in poll periods':<50}{'median':>8}{'worst':>8}{'limit':>8}")
    for name in options.wires:
        with tempfile.TemporaryDirectory() as folder:
            found = silences(Path(folder), options.cycles, WIRES[name])
        rows.append((f"{name}: silence noticed", found["noticed"], NOTICE_LIMIT))
        rows.append((f"{name}: first good sample after", found["back"], RETURN_LIMIT))
        for words, values, limit in rows[-2:]:
            print(f"{words:<50}{statistics.median(values):>8.2f}{max(values):>8.2f}{limit:>8.1f}")
    if options.devices:
        with tempfile.TemporaryDirectory() as folder:
            many = vanish_together(Path(folder), options.devices)
        print(f"{options.devices} devices return together, the last after {many:.2f} periods")
    sys.exit(any(max(values) > limit for _, values, limit in rows))


def on(wire: Wire, folder: Path, port: int = 0) -> str:
    """A plant of one unit behind a wire."""
    source = wire.source.format(folder=folder, port=port)
    plant = plant_file(1, folder / "data")
    if wire.value is not None:
        source += register_map(plant, wire.value)
        plant = f"[analysis]\nmax_frequency_hz = 4.0\n{plant}"
    return re.sub(r'kind = "modbus_ring"\n.*?\n\n', source + "\n", plant, flags=re.S)


def register_map(plant: str, value: str) -> str:
    """A map of floats for everything that the unit of a plant file has."""
    found = tomllib.loads(plant)["unit"][0]
    lines = [f'channel = "{channel["id"]}"\n{value}' for channel in found["channel"]]
    lines += [f'channel = "{slow["id"]}"\n' for slow in found["slow_channel"]]
    return "".join(
        f'[[unit.source.map.value]]\n{line}address = {100 + 2 * n}\ntype = "float32"\n'
        for n, line in enumerate(lines)
    )


def silences(folder: Path, n_cycles: int, wire: Wire) -> dict[str, list[float]]:
    """Let one DAQ fall silent and answer again, many times."""
    plant = folder / "one.toml"
    plant.write_text(on(wire, folder), encoding="utf-8")
    found: dict[str, list[float]] = {"noticed": [], "back": []}
    with padwatch("daq", str(plant)) as (process, line):
        port = re.search(r'"port": (\d+)|socket://[^:]+:(\d+)', line)
        plant.write_text(on(wire, folder, int(port[1] or port[2]) if port else 0), encoding="utf-8")
        with padwatch("run", str(plant), "--port", "0") as (_, said):
            units = said.split()[-1] + "api/v1/units"
            until(units, "connected")
            for _ in range(n_cycles):
                time.sleep(1.0)
                for key, number, state in (
                    ("noticed", signal.SIGSTOP, "not_connected"),
                    ("back", signal.SIGCONT, "connected"),
                ):
                    took_s = after_signal(process, number, units, state)
                    found[key].append(took_s / wire.poll_s)
                    time.sleep(random.uniform(1.0, 2.0))  # noqa: S311
    return found


def after_signal(process: subprocess.Popen[str], number: int, units: str, state: str) -> float:
    """Seconds from a signal to the DAQ until all units are in this state."""
    process.send_signal(number)
    started = time.monotonic()
    until(units, state)
    return time.monotonic() - started


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
