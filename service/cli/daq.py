"""`padwatch daq`: simulated or recorded units behind a simulated DAQ."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Annotated

import typer
import uvloop

from acquisition.clock import Clock, SystemClock
from acquisition.errors import ConfigError
from acquisition.recordings.reader import open_recording
from acquisition.simulated.devices.recorded import RecordedFeed
from acquisition.simulated.feed import SampleFeed
from core.units import ns_from_s
from service.app.recordings import recordings_by_unit, selection_of
from service.app.simulated_daq import Wire, daq_of, over_wire, run_daq
from service.cli.options import PlantPath, fail, option
from service.measuring.simulated_sources import simulated_feed
from service.settings.plant import PlantFile, load_plant_file
from service.settings.units import UnitSettings

SpeedOption = Annotated[
    float,
    typer.Option(min=0.0, max=1000.0, help="Playback speed; 0: as fast as possible."),
]


class FastClock:
    """Clock that runs faster or slower than a reference clock by a constant factor; for replays.

    Parameters
    ----------
    speed
        Seconds of this clock per second of the reference clock; above 0.

    Raises
    ------
    ValueError
        If the speed is not positive.
    """

    def __init__(self, clock: Clock, speed: float) -> None:
        if not speed > 0.0:
            raise ValueError(f"speed must be above 0, got {speed}")
        self._clock, self._speed = clock, speed
        self._start_ns, self._start_s = clock.now_ns(), clock.monotonic_s()

    def now_ns(self) -> int:
        """Return the time at creation plus the scaled elapsed time, ns since 1970 UTC."""
        return self._start_ns + ns_from_s(self.monotonic_s())

    def monotonic_s(self) -> float:
        """Return the time since creation, in seconds of this clock."""
        return (self._clock.monotonic_s() - self._start_s) * self._speed

    async def sleep(self, duration_s: float) -> None:
        """Suspend the current task for `duration_s` seconds of this clock."""
        await self._clock.sleep(duration_s / self._speed)


def daq(
    plant_file: PlantPath,
    recording: Annotated[
        list[Path] | None,
        typer.Option(help="Play this recording of a unit instead of simulations; repeatable."),
    ] = None,
    through: Annotated[Wire | None, option("Serve by this protocol on loopback instead.")] = None,
    speed: SpeedOption = 1.0,
    control: Annotated[
        bool,
        typer.Option(help="Read commands UNIT FAULT [COUNT] from standard input; stop at its end."),
    ] = False,
) -> None:
    """Run simulated DAQs of the units, with the protocols and addresses in the plant file.

    Prints one JSON line with the address of each unit, then runs until Ctrl-C or SIGTERM. At speed
    0, a device delivers samples as fast as they are read.
    """
    plant = load_plant_file(plant_file)
    if through is not None:
        plant = over_wire(plant, through)
    clock = FastClock(SystemClock(), speed) if speed else None
    feeds = _recorded_feeds(plant, recording) if recording else _simulated_feeds(plant)
    try:
        servers = {
            unit.id: daq_of(unit, feeds[unit.id], clock, recorded=bool(recording))
            for unit in plant.unit
            if unit.id in feeds
        }
    except LookupError as error:
        fail(str(error))
    uvloop.run(run_daq(servers, typer.echo, controlled=control))


def _recorded_feeds(plant: PlantFile, recordings: list[Path]) -> dict[str, SampleFeed]:
    played = recordings_by_unit(recordings, plant)

    def feed(unit: UnitSettings) -> SampleFeed:
        recording = open_recording(played[unit.id])
        return RecordedFeed(recording, selection_of(recording, unit))

    return {unit.id: feed(unit) for unit in plant.unit if unit.id in played}


def _simulated_feeds(plant: PlantFile) -> dict[str, SampleFeed]:
    clock = SystemClock()
    feeds = {unit.id: simulated_feed(unit, clock) for unit in plant.unit if unit.simulation}
    if not feeds:
        raise ConfigError(
            "no unit of this plant file has a [unit.simulation] table; add one, or use --recording"
        )
    now_ns = clock.now_ns()  # the first feed was built seconds ago
    for feed in feeds.values():
        feed.begin_at(now_ns)
    return {**feeds}


STOP_S = 3.0
"""Time for which a child may stop by itself before it is killed, s."""

TERMINALS = "/dev/pts/"

Endpoints = dict[str, dict[str, str | int]]


@dataclass(frozen=True)
class RunningDaq:
    """Simulated DAQ that runs as a child process.

    Parameters
    ----------
    endpoints
        Address of each unit by unit id, as keys and values of the settings of its source.
    over
        Event of each unit, set at the end of its recording.
    gone
        Set when the process has ended.
    """

    endpoints: Endpoints
    over: dict[str, threading.Event]
    gone: threading.Event = field(default_factory=threading.Event)

    @property
    def has_failed(self) -> bool:
        """Whether the DAQ ended before the end of its recordings."""
        return self.gone.is_set() and not all(over.is_set() for over in self.over.values())

    def attached(self, plant: PlantFile) -> PlantFile:
        """Return a copy of the plant file whose sources have the addresses of this DAQ."""
        sources = [u.source.model_copy(update=self.endpoints.get(u.id, {})) for u in plant.unit]
        pairs = zip(plant.unit, sources, strict=True)
        units = tuple(unit.model_copy(update={"source": source}) for unit, source in pairs)
        return plant.model_copy(update={"unit": units})


@contextmanager
def held_lines(endpoints: Endpoints) -> Iterator[None]:
    """Keep the pseudo-terminals of endpoints open, so that the system does not reuse their names.

    A reader that reconnects after its DAQ has ended would otherwise open, and lock, the terminal
    of another program.
    """
    places = [place for endpoint in endpoints.values() for place in endpoint.values()]
    with ExitStack() as stack:
        for place in places:
            if isinstance(place, str) and place.startswith(TERMINALS):
                with suppress(OSError):  # the DAQ has ended; its reader reports that
                    stack.callback(os.close, os.open(place, os.O_RDWR | os.O_NOCTTY))
        yield


@contextmanager
def daq_process(arguments: Sequence[str]) -> Iterator[RunningDaq]:
    """Run ``padwatch daq`` with `arguments` as a child process; yield it once it serves; stop it.

    Raises `CommandError` if the child ends before it serves; it has printed the reason.
    """
    with subprocess.Popen(  # noqa: S603  our own program
        [sys.executable, "-P", "-m", "service.cli.main", "daq", *arguments, "--control"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,  # Ctrl-C is for this process, which stops the DAQ last
    ) as process:
        news = None
        try:
            line = process.stdout.readline() if process.stdout else b""
            if not line or process.stdout is None:
                fail("the simulated DAQ did not start; its message above gives the reason")
            endpoints: Endpoints = json.loads(line)
            daq = RunningDaq(endpoints, {unit: threading.Event() for unit in endpoints})
            news = threading.Thread(target=_listen, args=(process.stdout, daq), daemon=True)
            news.start()
            with held_lines(endpoints):
                yield daq
        finally:
            _stop(process)
            if news is not None:
                news.join()  # before its pipe is closed


def _stop(process: "subprocess.Popen[bytes]") -> None:
    process.terminate()
    try:
        process.wait(STOP_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _listen(stdout: IO[bytes], daq: RunningDaq) -> None:
    for line in stdout:
        ended = json.loads(line).get("ended")
        if ended in daq.over:
            daq.over[ended].set()
    daq.gone.set()
