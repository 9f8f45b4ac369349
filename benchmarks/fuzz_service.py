"""A running service of one simulated unit with a past, and a key for each role."""

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from service.app.storage import open_store
from service.cli.offline.demo_history import fill
from service.measuring.simulated_sources import simulated_history
from service.settings.plant import load_plant_file

DEMO = Path(__file__).parents[1] / "deploy" / "demo-life.toml"
PADWATCH = (sys.executable, "-m", "service.cli.main")
ROLES = ("viewer", "operator", "engineer", "admin")
STOP_S = 30.0

Process = subprocess.Popen[str]


@dataclass(frozen=True)
class Fuzzed:
    """What is fuzzed.

    Parameters
    ----------
    keys
        By role.
    log
        Where its standard error goes.
    """

    url: str
    pid: int
    keys: dict[str, str]
    log: Path


@contextmanager
def fuzzed_service(
    folder: Path, past_years: float, live: bool, roles: Sequence[str] = ROLES
) -> Iterator[Fuzzed]:
    """Start a DAQ, if it is to be live, and the service; both end with the context."""
    running: list[Process] = []
    plant = write_plant(folder, 1)
    log = folder / "service.log"
    try:
        if live:
            running.append(_start(("daq", str(plant), "--control"), folder / "daq.log"))
            write_plant(folder, json.loads(_line(running[0]))["U1"]["port"])
        if past_years:
            _fill(plant, past_years)
        keys = {role: _key(plant, role) for role in roles if role in ROLES}
        running.append(_start(("run", str(plant), "--port", "0"), log))
        url = _line(running[-1]).removeprefix("padwatch: ").strip().rstrip("/")
        yield Fuzzed(url, running[-1].pid, keys, log)
    finally:
        for process in reversed(running):
            _stop(process)


def write_plant(folder: Path, daq_port: int) -> Path:
    """The first unit of the demo, with its DAQ at a port; 1 for one that nobody listens at."""
    path = folder / "plant.toml"
    head, unit = DEMO.read_text(encoding="utf-8").split("[[unit]]\n")[:2]
    head = re.sub(r"(?m)^data_folder = .*$", f'data_folder = "{folder}/data"', head)
    text = f"{head}[[unit]]\n{unit}".replace("port = 0", f"port = {daq_port}")
    path.write_text(text, encoding="utf-8")
    return path


def _fill(plant_file: Path, past_years: float) -> None:
    plant, now_ns = load_plant_file(plant_file), time.time_ns()
    store = open_store(plant)
    fill(store.films, plant, {"U1": simulated_history(plant.unit[0], now_ns, past_years)}, now_ns)
    store.close()


def _key(plant: Path, role: str) -> str:
    command = (*PADWATCH, "keys", "create", str(plant), f"fuzz-{role}", "--role", role, "--json")
    said = subprocess.run(command, capture_output=True, text=True, check=True, cwd=plant.parent)
    return str(json.loads(said.stdout)["key"])


def _start(arguments: tuple[str, ...], log: Path) -> Process:
    with log.open("w", encoding="utf-8") as errors:
        return subprocess.Popen(
            [*PADWATCH, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
            cwd=log.parent,
        )


def _line(process: Process) -> str:
    line = process.stdout.readline() if process.stdout else ""
    if not line:
        raise RuntimeError("the process ended without a word; see its log")
    return line


def _stop(process: Process) -> None:
    process.send_signal(signal.SIGTERM)
    try:
        process.wait(STOP_S)
    finally:
        process.kill()
        process.wait()
