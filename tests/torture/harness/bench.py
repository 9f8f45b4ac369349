"""`Bench`: a ledger DAQ, bad links to it, a service whose clock may be wrong, and a client."""

import signal
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from harness.bad_link import BadLinks, bad_links
from harness.checker import check
from harness.ledger_daq import LedgerDaq, ledger_daq
from harness.ledger_plant import LedgerPlant
from harness.service_rig import ServiceRig, until
from harness.watch import Watch, silent_healthy_s

LINK_ALARM = "[alarms]\nlink_lost_after_s = 1.0\n"
"""Three polls of 0.5 s are to raise it."""

FRESH_S = 0.6
"""Data that is not older came with the newest poll."""


@dataclass
class Seen:
    """What a fault has led to, in seconds since it began or ended."""

    lost_s: list[float] = field(default_factory=list)
    back_s: list[float] = field(default_factory=list)

    def line(self, name: str) -> str:
        """A line of the table."""
        lost, back = (f"{np.max(s):5.2f}" if s else "    -" for s in (self.lost_s, self.back_s))
        return f"  {name:<34}{len(self.back_s):>4} times, alarm after {lost} s, back after {back} s"


class Bench:
    """A DAQ, bad links to it, a service and a client."""

    def __init__(
        self,
        plant: LedgerPlant,
        daq: LedgerDaq,
        links: BadLinks,
        folder: Path,
        extra: str = "",
        wrong_s: float = 0.0,
        time_zone: str = "UTC",
    ) -> None:
        self.plant, self.daq, self.links = plant, daq, links
        self._wall_clock = folder / "wall-clock"
        self._wall_clock.write_text(f"{wrong_s}", encoding="ascii")
        self.plant_file = plant.write(folder / "plant.toml", folder / "data", links.ports, extra)
        environment = {"WALL_CLOCK": str(self._wall_clock), "TZ": time_zone}
        self.rig = ServiceRig(self.plant_file, "harness.stepped_service", environment=environment)
        self.watch = Watch(plant, daq.offered)
        self.n_before = daq.offered().samples

    def begin(self) -> None:
        """Start the service and the client."""
        self.rig.start()
        self.rig.wait_ready()
        self.watch.begin(self.rig.url)
        self.wait_until_well()

    def step(self, wrong_s: float) -> None:
        """Let the service's wall clock be wrong by so much from now on."""
        self._wall_clock.write_text(f"{wrong_s}", encoding="ascii")
        self.rig.signal(signal.SIGUSR1)

    def freeze(self, seconds: float) -> None:
        """Stop the service in its tracks, and let it go on."""
        self.rig.signal(signal.SIGSTOP)
        time.sleep(seconds)
        self.rig.signal(signal.SIGCONT)

    def states(self) -> set[str]:
        """Of the links, as the service sees them."""
        with self.rig.api() as api:
            return {unit["source"]["state"] for unit in api.get("/api/v1/units")}

    def active(self, kind: str) -> list[dict[str, Any]]:
        """Active alarms of a kind."""
        with self.rig.api() as api:
            found = api.get("/api/v1/alarms")["alarms"]
        return [one for one in found if one["kind"] == kind and one["level"] is not None]

    def raised(self) -> Counter[str]:
        """How often alarms of a kind were raised."""
        with self.rig.api() as api:
            events = api.get("/api/v1/alarms/events?limit=1000")["events"]
        return Counter(event["kind"] for event in events if event["change"] == "raised")

    def gaps(self) -> list[dict[str, Any]]:
        """Recorded gaps of the first unit."""
        ever = "start=2020-01-01T00:00:00Z&end=2100-01-01T00:00:00Z"
        with self.rig.api() as api:
            found: list[dict[str, Any]] = api.get(f"/api/v1/units/U1/gaps?{ever}")
        return found

    def wait_until_well(self) -> float:
        """Until fresh samples of all units are here; in seconds."""
        begun_s = time.monotonic()

        def is_well() -> bool:
            with self.rig.api() as api:
                sources = [unit["source"] for unit in api.get("/api/v1/units")]
            return all(s["state"] == "connected" and s["data_age_s"] < FRESH_S for s in sources)

        until(is_well)
        return time.monotonic() - begun_s

    def wait_for_alarms(self) -> float:
        """Until every link has its alarm; in seconds."""
        begun_s = time.monotonic()
        until(lambda: len(self.active("link_lost")) == self.plant.n_units)
        return time.monotonic() - begun_s

    def findings(self) -> dict[str, Any]:
        """What is wrong with what is stored and was shown."""
        time.sleep(3.0 * self.plant.refresh_s)
        self.rig.stop()
        self.watch.end()
        offered = self.daq.offered()
        lives = {unit: [self.n_before.get((unit, 1), 0)] for unit in self.plant.units}
        for unit in self.plant.units:
            lives[unit].append(offered.samples[unit, 1])
        found = check(self.plant, self.plant_file, offered, lives, self.watch)
        silent_s = silent_healthy_s(self.plant, offered, self.watch.looks)
        return {**found.wrong, **({"silent-healthy seconds": silent_s} if silent_s else {})}


@contextmanager
def bench_of(
    plant: LedgerPlant,
    folder: Path,
    seed: int,
    extra: str = "",
    wrong_s: float = 0.0,
    time_zone: str = "UTC",
) -> Iterator[Bench]:
    """Build it, and let it run.

    Parameters
    ----------
    extra
        More tables of the plant file.
    wrong_s
        By how much the service's wall clock is wrong.
    """
    with ledger_daq(plant, folder) as daq, bad_links(daq.ports, seed) as links:
        bench = Bench(plant, daq, links, folder, extra, wrong_s, time_zone)
        with bench.rig:
            try:
                bench.begin()
                yield bench
            finally:
                bench.watch.end()
