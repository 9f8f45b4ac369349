"""A real plant: simulated DAQ and service as processes."""

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path

from rigs.command_line import OPEN, free_port

from acquisition.clock import SystemClock
from service.api.auth.authenticator import Authenticator
from service.app.storage import open_store
from service.cli.accounts import access_of
from service.cli.offline.demo_history import fill
from service.measuring.simulated_sources import simulated_history
from service.settings.plant import PlantFile, load_plant_file
from service.store.access.identities import Role

DEPLOY = Path(__file__).parents[2] / "deploy"
DEMO, DEMO_LIFE = DEPLOY / "demo.toml", DEPLOY / "demo-life.toml"
PAST_YEARS = 0.2
PADWATCH = [sys.executable, "-m", "service.cli.main"]
STOP_S = 10.0

QUICK_ANALYSIS = """
[analysis]
segment_samples = 4096
overlap = 0.5
n_segments = 6

[alarms]
link_lost_after_s = 2.0

[spectra]
dense_every_s = 1.0
"""
"""The first result after seven seconds, then one every 3.4, each with its spectrum; the plant's own
are 14 and 12."""

OWN_TABLES = re.compile(r"^\[(?:analysis|alarms)\]\n(?:[^\[\n].*\n|\n)*", re.MULTILINE)
"""What an example itself says of these."""

PASSWORD = "the river is high in may"  # noqa: S105 - of accounts that exist in tests alone

RECORDED = "U1-20260101T000000.000Z-order1_shaft_x"
"""Name of the one recording of the guarded plant."""


class Plant(ExitStack):
    """Unit U1 of a demo plant, its DAQ and service: processes that end when it is left."""

    def __init__(self, folder: Path, example: Path = DEMO) -> None:
        super().__init__()
        self._folder, self._example = folder, example
        self._daq: subprocess.Popen[str] | None = None
        self._service: subprocess.Popen[str] | None = None
        self._daq_port = free_port()
        self.url = ""
        self.settings = QUICK_ANALYSIS
        self.is_open = True

    def start_daq(self) -> None:
        self._daq = self._start("daq", str(self._plant_file()), "--control")
        self._daq_port = json.loads(read_line(self._daq))["U1"]["port"]

    def start_service(self) -> None:
        """The first time on a free port, then on the same one."""
        port = self.url.rstrip("/").rpartition(":")[2] or "0"
        program = [sys.executable, "-c", OPEN] if self.is_open else PADWATCH
        self._service = self._start("run", str(self._plant_file()), "--port", port, by=program)
        self.url = read_line(self._service).removeprefix("padwatch: ").strip()

    def read_token(self) -> str:
        """Token for the first account, which the service prints where there is none."""
        assert self._service is not None
        return read_line(self._service).rpartition(" ")[2].strip()

    def stop_service(self) -> None:
        stop(self._service)

    @contextmanager
    def silent_daq(self) -> Iterator[None]:
        """Let the DAQ neither sample nor answer, as if its cable were pulled."""
        assert self._daq is not None
        self._daq.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self._daq.send_signal(signal.SIGCONT)

    def add_accounts(self) -> None:
        """Add an account of each role, named after it, before anything is started."""
        with access_of(self._plant_here(), creates=True) as access:
            people = Authenticator(access, SystemClock())
            for role in Role:
                people.add(role.value, role, PASSWORD)

    def live_first(self) -> None:
        """Give the unit a past with a learned baseline before anything is started."""
        plant, now_ns = self._plant_here(), time.time_ns()
        with closing(open_store(plant)) as store:
            lives = {"U1": simulated_history(plant.unit[0], now_ns, PAST_YEARS)}
            fill(store.films, plant, lives, now_ns)

    def _plant_here(self) -> PlantFile:
        """The plant as a process that runs in its folder sees it."""
        plant = load_plant_file(self._plant_file())
        folder = str(self._folder / plant.service.data_folder)
        service = plant.service.model_copy(update={"data_folder": folder})
        return plant.model_copy(update={"service": service})

    def _start(self, *arguments: str, by: Sequence[str] = PADWATCH) -> "subprocess.Popen[str]":
        log = self.enter_context((self._folder / f"{arguments[0]}.log").open("a"))
        process = subprocess.Popen(
            [*by, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            cwd=self._folder,
        )
        self.callback(stop, process)
        return process

    def _plant_file(self) -> Path:
        head, units = self._example.read_text().split("[[unit]]", 1)
        first_unit = units.split("[[unit]]", 1)[0].replace("port = 0", f"port = {self._daq_port}")
        path = self._folder / "plant.toml"
        path.write_text(f"{OWN_TABLES.sub('', head)}{self.settings}\n[[unit]]{first_unit}")
        return path


def read_line(process: "subprocess.Popen[str]") -> str:
    line = process.stdout.readline() if process.stdout else ""
    assert line, "the process ended without a word; see its log beside the plant file"
    return line


def stop(process: "subprocess.Popen[str] | None") -> None:
    if process is None:
        return
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
    try:
        process.wait(STOP_S)
    finally:
        process.kill()  # one that does not end when asked fails the test, but does not outlive it
        process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()
