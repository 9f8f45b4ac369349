"""Kill acquisition, analysis and NATS at random moments, while a device goes on offering."""

import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from harness.nats_server import NatsServer
from harness.service_rig import ServiceRig, until
from harness.stream_rig import positions

ALIVE_S = 1.5
"""For how long all of them run between two kills, on average."""

VICTIMS = ("acquire", "analyse", "nats")


@dataclass
class Kills:
    """What was killed how often, and how far the analysis was after each."""

    killed: Counter[str] = field(default_factory=Counter)
    reached: list[int] = field(default_factory=list)


def kill_them(
    acquire: ServiceRig,
    analyse: ServiceRig,
    server: NatsServer,
    database: Path,
    n_kills: int,
    rng: np.random.Generator,
) -> Kills:
    """Kill one of them at a time, start it again a little later, and see that results go on."""
    done = Kills()
    rigs = {"acquire": acquire, "analyse": analyse}
    for rig in rigs.values():
        rig.start()
    for number in range(n_kills):
        victim = VICTIMS[number % len(VICTIMS)]
        time.sleep(min(rng.exponential(ALIVE_S), 4.0 * ALIVE_S))
        thing = rigs.get(victim, server)
        thing.kill()
        done.killed[victim] += 1
        time.sleep(rng.uniform(0.0, 0.5))
        thing.start()
        if number % 5 == 4:
            before = _reached(database)
            until(lambda before=before: _reached(database) > before)
            done.reached.append(_reached(database))
    acquire.wait_ready()
    before = _reached(database)
    until(lambda: _reached(database) > before + 20)
    acquire.stop()
    _settle(database)
    analyse.stop()
    return done


def _reached(database: Path) -> int:
    return max(positions(database).values(), default=0)


def _settle(database: Path) -> None:
    """Wait until nothing more comes of what is on the stream."""
    seen, since_s = _reached(database), time.monotonic()
    while time.monotonic() - since_s < 3.0:
        time.sleep(0.2)
        if _reached(database) != seen:
            seen, since_s = _reached(database), time.monotonic()
