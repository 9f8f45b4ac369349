"""A real plant and a real browser: simulated DAQ and service as processes, pages in Chromium."""

import json
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
from playwright.async_api import Browser, ConsoleMessage, Page, async_playwright

from service.demo.past import fill
from service.settings.loading import load_plant_file
from service.wiring.simulated_lives import simulated_history
from service.wiring.stores import open_store

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

ROLES = ("viewer", "operator", "engineer", "admin")
PASSWORD = "the river is high in may"  # noqa: S105 - of accounts that exist in tests alone

TO_SET_UP = "to make the first account"
"""In what the service says before its address, where somebody must log in and nobody can."""

CHROMIUM = next(
    filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None
)

QUIET = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


class Plant:
    """Unit U1 of a demo plant: its DAQ and the service that watches it."""

    def __init__(self, folder: Path, example: Path = DEMO) -> None:
        self._folder, self._example = folder, example
        self._processes = ExitStack()
        self._daq: subprocess.Popen[str] | None = None
        self._service: subprocess.Popen[str] | None = None
        self._daq_port = free_port()
        self.url = self.token = ""
        self.settings = QUICK_ANALYSIS

    def start_daq(self) -> None:
        self._daq = self._start("daq", str(self._plant_file()), "--control")
        self._daq_port = json.loads(read_line(self._daq))["U1"]["port"]

    def stop_daq(self) -> None:
        stop(self._daq)

    def start_service(self) -> None:
        """The first time on a free port, then on the same one."""
        port = self.url.rstrip("/").rpartition(":")[2] or "0"
        self._service = self._start("run", str(self._plant_file()), "--port", port)
        line = read_line(self._service)
        if TO_SET_UP in line:
            self.token = line.rpartition(" ")[2].strip()
            line = read_line(self._service)
        self.url = line.removeprefix("padwatch: ").strip()

    def stop_service(self) -> None:
        stop(self._service)

    def add_account(self, name: str, role: str, password: str) -> None:
        """What an admin does at the computer's own prompt."""
        given, wanted = os.pipe()
        with os.fdopen(wanted, "w") as pipe:
            pipe.write(password)
        command = [*PADWATCH, "users", "add", str(self._plant_file()), name, "--role", role]
        with os.fdopen(given):
            subprocess.run(
                [*command, "--password-fd", str(given)],
                pass_fds=[given],
                cwd=self._folder,
                check=True,
                capture_output=True,
            )

    def live_first(self) -> None:
        """Give the unit a past with a learned baseline before anything is started."""
        plant = load_plant_file(self._plant_file())
        folder = self._folder / plant.service.data_folder
        service = plant.service.model_copy(update={"data_folder": str(folder)})
        plant, now_ns = plant.model_copy(update={"service": service}), time.time_ns()
        store = open_store(plant)
        lives = {"U1": simulated_history(plant.unit[0], now_ns, PAST_YEARS)}
        fill(store.films, plant, lives, now_ns)
        store.close()

    def __enter__(self) -> "Plant":
        return self

    def __exit__(self, *_: object) -> None:
        self._processes.close()

    def _start(self, *arguments: str) -> "subprocess.Popen[str]":
        log = self._processes.enter_context((self._folder / f"{arguments[0]}.log").open("a"))
        process = subprocess.Popen(
            [*PADWATCH, *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            cwd=self._folder,
        )
        self._processes.callback(stop, process)
        return process

    def _plant_file(self) -> Path:
        head, units = self._example.read_text().split("[[unit]]", 1)
        first_unit = units.split("[[unit]]", 1)[0].replace("port = 0", f"port = {self._daq_port}")
        path = self._folder / "plant.toml"
        path.write_text(f"{OWN_TABLES.sub('', head)}{self.settings}\n[[unit]]{first_unit}")
        return path


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


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


@pytest.fixture(scope="session")
def chromium() -> str:
    """Path of an installed Chromium."""
    if CHROMIUM is None:
        pytest.skip("no chromium, chromium-browser or google-chrome is installed")
    return CHROMIUM


@pytest.fixture
def new_plant(chromium: str, tmp_path: Path) -> Iterator[Plant]:  # noqa: ARG001 - skip before start
    """A plant of the test's own, nothing of it running yet."""
    with Plant(tmp_path) as plant:
        yield plant


@pytest.fixture(scope="session")
def running_plant(chromium: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:  # noqa: ARG001
    """A plant in good health, shared by tests that leave it so."""
    with Plant(tmp_path_factory.mktemp("plant")) as plant:
        plant.start_daq()
        plant.start_service()
        yield plant


@pytest.fixture(scope="session")
def living_plant(chromium: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:  # noqa: ARG001
    """A plant whose films have been watched for two months and a half."""
    with Plant(tmp_path_factory.mktemp("life"), DEMO_LIFE) as plant:
        plant.live_first()
        plant.start_daq()
        plant.start_service()
        yield plant


@pytest.fixture(scope="session")
def guarded_plant(chromium: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:  # noqa: ARG001
    """A plant without a DAQ, so that it has an alarm, and with an account of each role."""
    with Plant(tmp_path_factory.mktemp("guarded")) as plant:
        for role in ROLES:
            plant.add_account(role, role, PASSWORD)
        plant.start_service()
        yield plant


@pytest.fixture
async def browser(chromium: str) -> AsyncIterator[Browser]:
    """A browser without a past."""
    async with async_playwright() as playwright:
        opened = await playwright.chromium.launch(executable_path=chromium, args=QUIET)
        yield opened
        await opened.close()


@pytest.fixture
async def page(browser: Browser) -> Page:
    """A page on a control-room screen."""
    return await browser.new_page(viewport={"width": 1280, "height": 800})


@pytest.fixture
async def remote_page(browser: Browser) -> Page:
    """A page on a screen elsewhere, behind the plant's proxy: there one must log in."""
    headers = {"X-Forwarded-For": "192.0.2.7"}
    return await browser.new_page(
        viewport={"width": 1280, "height": 800}, extra_http_headers=headers
    )


@pytest.fixture
def password() -> str:
    """Of all accounts of the guarded plant."""
    return PASSWORD


@pytest.fixture
async def phone_page(browser: Browser) -> Page:
    """A page on a phone."""
    return await browser.new_page(viewport={"width": 360, "height": 780}, has_touch=True)


@pytest.fixture
def complaints_of() -> Callable[[Page], list[str]]:
    """Collects what a page's console complains of, from now on."""

    def collect(page: Page) -> list[str]:
        complaints: list[str] = []

        def note(message: ConsoleMessage) -> None:
            if message.type in ("error", "warning"):
                complaints.append(message.text)

        page.on("console", note)
        page.on("pageerror", lambda error: complaints.append(str(error)))
        return complaints

    return collect


@pytest.fixture
def picture_of(tmp_path: Path, request: pytest.FixtureRequest) -> Callable[[Page, str], object]:
    """Saves a picture of a page in PADWATCH_PICTURES, or beside the test's other files."""
    folder = Path(os.environ.get("PADWATCH_PICTURES", tmp_path))

    async def save(page: Page, name: str) -> None:
        path = folder / f"{request.node.originalname}-{name}.png"
        await page.screenshot(path=path, full_page=True)

    return save
