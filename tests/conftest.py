"""What tests of every package share: a plant of numbers, a clock, results, readings of films."""
# ruff: noqa: E402 - what is set first must be set before numpy is imported

import gc
import os
import sys

gc.disable()  # until the tests are collected: nothing of them is garbage
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # workers share the cores: threads only wait

# Without bytecode every worker and every started program compiles a thousand files again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

import asyncio
import re
import shutil
import subprocess
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
import structlog
import uvloop
from hypothesis import settings as hypothesis_settings
from rigs.assessments import assessment as build_assessment
from rigs.blocks import cell_block

import acquisition.can  # noqa: F401 - loads python-can without pandas
from acquisition.simulated.feed import FeedEndedError
from core.arrays import FloatArray
from core.baseline.history import StiffnessHistory
from core.monitor.assessment import Assessment
from core.samples.blocks import SampleBlock
from core.samples.calibration import ChannelCalibration, SlowCalibration, UnitCalibration

NS_PER_S = 1_000_000_000

# a busy machine is slow at times: that is no failure
hypothesis_settings.register_profile("padwatch", deadline=None)
hypothesis_settings.load_profile("padwatch")
START_NS = 1_767_225_600 * NS_PER_S
SLOW = ("tests/system/", "tests/torture/", "tests/browser/")


@pytest.hookimpl(trylast=True)  # when other tiers have been left out
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Refuse a test that would be in two tiers; begin with those that take long.

    Each worker begins with an equal part of the list. Each folder of slow tests begins a part of
    its own, so that one worker runs it, with one browser and plants that stay, and none of them
    is left to the end.
    """
    n_workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", 1))
    slow = [[item for item in items if item.nodeid.startswith(folder)] for folder in SLOW]
    slow[0].sort(key=lambda item: "test_film_alarm" not in item.nodeid)  # eight minutes
    rest = [item for item in items if not item.nodeid.startswith(SLOW)]
    n_items = len(items)
    items.clear()
    for n, folder in enumerate(slow):
        n_before = max(0, -(-n_items * n // n_workers) - len(items))
        items += [*rest[:n_before], *folder]
        del rest[:n_before]
    items += rest
    for item in items:
        if item.get_closest_marker("long") and item.get_closest_marker("torture"):
            raise pytest.UsageError(f"{item.nodeid} is marked both long and torture")


def pytest_collection_finish() -> None:
    """Keep thousands of collected tests out of every later look of the garbage collector."""
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name the optional tools that are missing, and how many tests were left out for each."""
    skipped = terminalreporter.stats.get("skipped", ())
    reasons = [report.longrepr[2].removeprefix("Skipped: ") for report in skipped]
    if reasons:
        counts = Counter(re.sub(r"^needs ", "", reason) for reason in reasons)
        left_out = "; ".join(f"{n} need {reason}" for reason, n in counts.most_common())
        terminalreporter.write_line(f"left out: {left_out}", yellow=True)


def pytest_asyncio_loop_factories() -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    """Run every test on the event loop of the program: others fail in other ways."""
    return {"uvloop": uvloop.new_event_loop}


@pytest.fixture(autouse=True)
def _logging_as_it_was() -> Iterator[None]:
    """A command that was run within a test leaves a log behind whose stream is closed."""
    yield
    structlog.reset_defaults()


class CountingFeed:
    """A converter whose channel 0 is the sample number modulo 2**15, channel c is c ahead."""

    def __init__(
        self,
        n_channels: int = 2,
        rate_hz: float = 600.0,
        start_ns: int = START_NS,
        slow: tuple[float, ...] = (45.0, float("nan")),
        stop_index: int | None = None,
    ) -> None:
        self._n_channels, self._stop_index = n_channels, stop_index
        self._rate_hz, self._start_ns = rate_hz, start_ns
        self.slow, self.ok = slow, (True,) * n_channels
        self.n_samples = 0
        self._calibration = calibration_in_counts(n_channels, rate_hz, len(slow))

    def advance(self, n_samples: int) -> SampleBlock:
        first = self.n_samples
        if first == self._stop_index:
            raise FeedEndedError
        self.n_samples += n_samples
        number = np.arange(first, self.n_samples) + np.arange(self._n_channels)[:, np.newaxis]
        return cell_block(
            epoch=7,
            first_index=first,
            start_ns=self._start_ns + round(first * NS_PER_S / self._rate_hz),
            rate_hz=self._rate_hz,
            counts=(number % 2**15).astype(np.int16),
            ok=self.ok,
            slow=self.slow,
            calibration=self._calibration,
        )


def calibration_in_counts(
    n_channels: int = 2, rate_hz: float = 600.0, n_slow: int = 2
) -> UnitCalibration:
    """One engineering unit per count, everything in range."""
    channel = ChannelCalibration(32768.0, 1.0, -32768.0, 32768.0)
    slow = tuple(SlowCalibration(f"slow{i}", -1e9, 1e9) for i in range(n_slow))
    return UnitCalibration("U1", rate_hz, (channel,) * n_channels, slow)


class SteppedClock:
    """Time that stands still unless somebody sleeps or steps it."""

    def __init__(self, start_ns: int = 1_767_225_600 * NS_PER_S) -> None:
        self._start_ns, self._elapsed_s = start_ns, 0.0

    def now_ns(self) -> int:
        return self._start_ns + round(self._elapsed_s * NS_PER_S)

    def monotonic_s(self) -> float:
        return self._elapsed_s

    async def sleep(self, duration_s: float) -> None:
        self.step(max(0.0, duration_s))
        await asyncio.sleep(0)

    def step(self, duration_s: float) -> None:
        self._elapsed_s += duration_s


@pytest.fixture
def stepped_clock() -> SteppedClock:
    return SteppedClock()


@pytest.fixture
def counting_feed() -> Callable[..., CountingFeed]:
    """Builds counting feeds; keywords as in `CountingFeed`."""
    return CountingFeed


@pytest.fixture
def counts_calibration() -> Callable[..., UnitCalibration]:
    """Builds calibrations that leave counts as they are."""
    return calibration_in_counts


@pytest.fixture(scope="session")
def assessment() -> Callable[..., Assessment]:
    """Builds assessments; keywords are readings."""
    return build_assessment


@pytest.fixture(scope="session")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate of 127.0.0.1, which only itself vouches for, and its key."""
    if shutil.which("openssl") is None:
        pytest.skip("needs openssl")
    folder = tmp_path_factory.mktemp("tls")
    files = folder / "a.crt", folder / "a.key"
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"]
    names = ["-subj", "/CN=test", "-addext", "subjectAltName=IP:127.0.0.1", "-days", "2"]
    out = ["-nodes", "-out", str(files[0]), "-keyout", str(files[1])]
    subprocess.run([*command, *names, *out], check=True, capture_output=True)
    return files


FilmLife = Callable[..., StiffnessHistory]


@pytest.fixture(scope="session")
def film_life() -> FilmLife:
    """Readings of one bearing: warm-ups, loads, seasons, lasting deviations, noise; not physics."""

    def live(
        seed: int,
        days: int = 120,
        lasting_std: float = 0.01,
        noise_std: float = 0.01,
        change: Callable[[FloatArray], FloatArray] | None = None,
        gain: Callable[[FloatArray], FloatArray] | None = None,
    ) -> StiffnessHistory:
        """Live for some days.

        Parameters
        ----------
        change, gain
            ln of what happens to the film, and to the bearing's transducer, at hours since start.
        """
        random = np.random.default_rng(seed)
        hours = np.arange(144 * days) / 6.0
        runs = (hours % 24 > 6.0) & (hours % 24 < 20.0)
        warmth = 1.0 - np.exp(-np.maximum(hours % 24 - 6.0, 0.0) / 2.0)
        season = 5.0 * np.sin(2.0 * np.pi * hours / 24.0 / 90.0)
        power_mw = np.where(_wander(random, hours, 1.0, 10.0) > 0.0, 300.0, 200.0)
        oil_c = 25.0 + season + 22.0 * warmth + _wander(random, hours, 1.0, 12.0)
        e = 0.35 + 0.1 * (power_mw > 250.0) - 0.05 * warmth
        e += _wander(random, hours, 0.03, 6.0) + _wander(random, hours, 0.02, 200.0)
        film = np.stack([_wander(random, hours, lasting_std, 12.0) for _ in "xy"])
        film += np.log(0.5e9) + 4.0 * (e - 0.4) - 0.02 * (oil_c - 45.0)
        film += 0.0 if change is None else change(hours)
        ln_gain = 0.0 if gain is None else gain(hours)
        shaft = np.log(60.0) + _wander(random, hours, 0.03, 5.0) - 0.7 * (film - np.log(0.5e9))
        bearing = shaft + film - np.log(1.18e9) + ln_gain
        one, pair = np.ones(hours.size), np.ones((2, hours.size))
        columns = {
            "time_ns": np.int64(1_700_000_000_000_000_000)
            + np.arange(hours.size) * 600_000_000_000,
            "speed_rpm": 92.3 * one,
            "power_mw": power_mw,
            "eccentricity_ratio": e + random.normal(0.0, 0.003, hours.size),
            "u_eccentricity": 0.003 * one,
            "attitude_deg": 30.0 * one,
            "oil_temperature_c": oil_c,
            "ln_k": film + ln_gain + random.normal(0.0, noise_std, film.shape),
            "u_random": max(noise_std, 1e-9) * pair,
            "shaft_um_pk": np.exp(shaft),
            "bearing_um_pk": np.exp(bearing),
        }
        return StiffnessHistory(**{name: column[..., runs] for name, column in columns.items()})

    return live


def _wander(
    random: np.random.Generator, hours: FloatArray, std: float, memory_h: float
) -> FloatArray:
    from scipy.signal import lfilter  # slow import, not needed by every process

    memory = float(np.exp(-(hours[1] - hours[0]) / memory_h))
    fresh = random.standard_normal(hours.size) * std * np.sqrt(1.0 - memory**2)
    return np.asarray(lfilter([1.0], [1.0, -memory], fresh))
