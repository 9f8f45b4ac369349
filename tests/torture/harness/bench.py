"""`Bench`: a ledger DAQ, a service that reads it, and a client; perhaps bad links between them."""

import signal
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Self

import numpy as np

from harness.bad_link import BadLinks
from harness.checker import Findings, check
from harness.ledger_daq import LedgerDaq, ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.service_rig import ServiceRig, until
from harness.watch import PERIOD_S, Watch, silent_healthy_s

LINK_ALARM = "[alarms]\nlink_lost_after_s = 1.0\n"
"""Three polls of 0.5 s are to raise it."""

STORE_ALARM = "[alarms]\nstore_failing_after_s = 0.5\n"

FRESH_S = 0.6
"""Data that is not older came with the newest poll."""


@dataclass
class Seen:
    """Effects of a fault, in seconds since it began or ended."""

    lost_s: list[float] = field(default_factory=list)
    back_s: list[float] = field(default_factory=list)

    def line(self, name: str) -> str:
        """Row of the table."""
        lost, back = (f"{np.max(s):5.2f}" if s else "    -" for s in (self.lost_s, self.back_s))
        return f"  {name:<34}{len(self.back_s):>4} times, alarm after {lost} s, back after {back} s"


class Bench:
    """A DAQ, a service and a client; the last two end when it is left.

    Parameters
    ----------
    extra
        More tables of the plant file.
    period_s
        Time from one question of the client to the next.
    data, ports
        Data folder of the service, and where it finds the devices, if not as usual.
    how
        How the service is run, as of `ServiceRig`.
    """

    def __init__(
        self,
        plant: LedgerPlant,
        daq: LedgerDaq,
        folder: Path,
        extra: str = "",
        period_s: float = PERIOD_S,
        data: Path | None = None,
        ports: Mapping[str, int] | None = None,
        **how: Any,
    ) -> None:
        self.plant, self.daq = plant, daq
        data, ports = data or folder / "data", ports or daq.ports
        self.plant_file = plant.write(folder / "plant.toml", data, ports, extra)
        self.rig = ServiceRig(self.plant_file, **how)
        self.watch = Watch(plant, period_s)
        self.lives: dict[str, list[int]] = {unit: [] for unit in plant.units}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.watch.end()
        self.rig.kill()

    def begin(self) -> float:
        """Start the service and the client; returns the seconds until the service is ready."""
        self.note_life()
        self.rig.start()
        ready_s = self.rig.wait_ready()
        self.watch.begin(self.rig.url)
        return ready_s

    def note_life(self) -> None:
        """Note the newest samples, as the process starts or for the last time."""
        samples = self.daq.offered().samples
        for unit in self.plant.units:
            self.lives[unit].append(samples.get((unit, 1), 0))

    def freeze(self, seconds: float) -> None:
        """Stop the service in its tracks, and let it go on."""
        self.rig.signal(signal.SIGSTOP)
        time.sleep(seconds)
        self.rig.signal(signal.SIGCONT)

    def get(self, path: str) -> Any:
        """Ask the service something."""
        with self.rig.api() as api:
            return api.get(f"/api/v1/{path}")

    def states(self) -> set[str]:
        """Return the states of the links, as the service sees them."""
        return {unit["source"]["state"] for unit in self.get("units")}

    def active(self, kind: str) -> list[dict[str, Any]]:
        """Return the active alarms of a kind."""
        found = self.get("alarms")["alarms"]
        return [one for one in found if one["kind"] == kind and one["level"] is not None]

    def raised(self) -> Counter[str]:
        """Count by kind how often alarms were raised."""
        events = self.get("alarms/events?limit=1000")["events"]
        return Counter(event["kind"] for event in events if event["change"] == "raised")

    def clock(self) -> dict[str, Any]:
        """Return the clock of the first unit's device, as the service sees it."""
        found: dict[str, Any] = self.get("units/U1")["source"]["clock"]
        return found

    def gaps(self) -> list[dict[str, Any]]:
        """Return the recorded gaps of the first unit."""
        ever = "start=2020-01-01T00:00:00Z&end=2100-01-01T00:00:00Z"
        found: list[dict[str, Any]] = self.get(f"units/U1/gaps?{ever}")
        return found

    def wait_for_newer(self) -> str:
        """Wait until a newer result is shown as current; returns its time."""

        def newest() -> str:
            units = self.get("overview")["units"]
            return max(bearing["time"] or "" for unit in units for bearing in unit["bearings"])

        shown = newest()
        until(lambda: newest() > shown)
        return newest()

    def wait_until_well(self) -> float:
        """Wait for fresh samples of all units; returns the seconds that it took."""
        begun_s = time.monotonic()

        def is_well() -> bool:
            sources = [unit["source"] for unit in self.get("units")]
            return all(s["state"] == "connected" and _age_s(s) < FRESH_S for s in sources)

        until(is_well)
        return time.monotonic() - begun_s

    def wait_for_alarms(self) -> float:
        """Wait until every link has its alarm; returns the seconds that it took."""
        begun_s = time.monotonic()
        until(lambda: len(self.active("link_lost")) == self.plant.n_units)
        return time.monotonic() - begun_s

    def end(self, units: Sequence[str] = ()) -> Findings:
        """Stop the service and the client, and compare the store with the truth."""
        exit_code = self.rig.stop()
        self.watch.end()
        assert exit_code == 0
        self.note_life()
        offered = self.daq.offered()
        return check(self.plant, self.plant_file, offered, self.lives, self.watch, units)

    def silent_healthy_s(self) -> float:
        """Return for how long the client was shown something absent or faulty as good."""
        return silent_healthy_s(self.plant, self.daq.offered(), self.watch.looks)

    def wrong(self) -> dict[str, Any]:
        """Return what is wrong with what is stored and was shown, after some more results."""
        time.sleep(3.0 * self.plant.refresh_s)
        found, silent_s = self.end(), self.silent_healthy_s()
        return {**found.wrong, **({"silent-healthy seconds": silent_s} if silent_s else {})}


class BadLinkBench(Bench):
    """A bench with bad links, whose service has a wall clock that may be wrong."""

    def __init__(
        self,
        plant: LedgerPlant,
        daq: LedgerDaq,
        links: BadLinks,
        folder: Path,
        wrong_s: float,
        time_zone: str,
        **more: Any,
    ) -> None:
        self.links = links
        self._wall_clock = folder / "wall-clock"
        self._wall_clock.write_text(f"{wrong_s}", encoding="ascii")
        environment = {"WALL_CLOCK": str(self._wall_clock), "TZ": time_zone}
        how = {"program": "harness.wrong_clock", "environment": environment}
        super().__init__(plant, daq, folder, ports=links.ports, **how, **more)

    def step(self, wrong_s: float) -> None:
        """Let the service's wall clock be wrong by so much from now on."""
        self._wall_clock.write_text(f"{wrong_s}", encoding="ascii")
        self.rig.signal(signal.SIGUSR1)


@contextmanager
def bench_of(
    plant: LedgerPlant,
    folder: Path,
    seed: int,
    wrong_s: float = 0.0,
    time_zone: str = "UTC",
    **more: Any,
) -> Iterator[BadLinkBench]:
    """Build a bench with bad links, and let it run.

    Parameters
    ----------
    wrong_s
        Error of the service's wall clock.
    more
        As of `Bench`.
    """
    with (
        ledger_daq(plant, folder) as daq,
        BadLinks(daq.ports, seed).listening() as links,
        BadLinkBench(plant, daq, links, folder, wrong_s, time_zone, **more) as bench,
    ):
        bench.begin()
        bench.wait_until_well()
        yield bench


def _age_s(source: dict[str, Any]) -> float:
    """Seconds since the newest samples arrived; service and test have the same clock."""
    return time.time() - datetime.fromisoformat(source["received"]).timestamp()
