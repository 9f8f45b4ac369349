"""Start, load, kill -9 and start again, any number of times; then look at all that is left."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from harness.bench import Bench
from harness.checker import Findings
from harness.service_rig import UNREACHABLE, Api, RefusedError, ServiceRig
from harness.truth import BEARINGS
from harness.watch import Watch

LIFE_S, LONGEST_LIFE_S = 3.0, 12.0
"""For how long a service runs once it is ready: on average, and at most."""

RECOVERY_S = 0.5
"""A kill in recovery comes within so long after the start of the process, or of its readiness."""

Trouble = Callable[[int], None]
"""What else goes wrong in a cycle."""


@dataclass
class Cycles:
    """What was done and found."""

    findings: Findings = field(default_factory=Findings)
    ready_s: list[float] = field(default_factory=list)
    silent_healthy_s: float = 0.0
    alarms: list[str] = field(default_factory=list)
    n_cycles: int = 0
    n_in_recovery: int = 0
    n_answers: int = 0

    def table(self) -> str:
        """One line for each figure."""
        ready = sorted(self.ready_s)
        p99 = ready[min(len(ready) - 1, int(0.99 * len(ready)))] if ready else 0.0
        figures = {
            "cycles": self.n_cycles,
            "of them killed in recovery": self.n_in_recovery,
            **self.findings.counts,
            "alarms not as before": len(self.alarms),
            "silent-healthy seconds": round(self.silent_healthy_s, 3),
            "ready after p50, s": round(ready[len(ready) // 2], 2) if ready else None,
            "ready after p99, s": round(p99, 2),
            "answers to the client": self.n_answers,
        }
        return "\n".join(f"  {name:<32}{value}" for name, value in figures.items())


def kill_cycles(
    bench: Bench,
    n_cycles: int,
    rng: np.random.Generator,
    life_s: float = LIFE_S,
    trouble: Trouble | None = None,
    least_s: float = 0.0,
) -> Cycles:
    """Kill a service at random moments; every fourth time within half a second of its start.

    Parameters
    ----------
    life_s, least_s
        How long it lives on average, when nothing else ends it, and at least.
    trouble
        Called in each life with its number.
    """
    done, rig, watch = Cycles(), bench.rig, bench.watch
    for number in range(n_cycles):
        done.n_cycles += 1
        if number % 4 == 1:
            done.n_in_recovery += 1
            bench.note_life()
            rig.start()
            _kill_in_recovery(number, rig, rng, done)
            continue
        _begin(bench, done)
        if number % 4 != 2:
            watch.wait_for_result()
        if trouble is not None:
            trouble(number)
        time.sleep(min(max(rng.exponential(life_s), least_s), LONGEST_LIFE_S))
        with rig.api() as api:
            act(api, number, watch)
        rig.kill()
        watch.end()
    _begin(bench, done)
    time.sleep(3.0 * bench.plant.refresh_s)
    done.findings = bench.end()
    done.silent_healthy_s = bench.silent_healthy_s()
    done.n_answers = watch.n_answers
    return done


def _begin(bench: Bench, done: Cycles) -> None:
    """Start the service and the client, and compare the alarms with their newest events."""
    done.ready_s.append(bench.begin())
    with bench.rig.api() as api:
        done.alarms += alarms_not_as_before(api)


def _kill_in_recovery(number: int, rig: ServiceRig, rng: np.random.Generator, done: Cycles) -> None:
    """Half of them before it is ready, half just after."""
    if number % 8 == 5:
        done.ready_s.append(rig.wait_ready())
    time.sleep(rng.uniform(0.0, RECOVERY_S))
    rig.kill()


def alarms_not_as_before(api: Api) -> list[str]:
    """Alarms that are not as their newest event left them, right after a start."""
    for _ in range(20):
        newest = _newest_states(api)
        shown = {one["id"]: one["state"] for one in api.get("/api/v1/alarms")["alarms"]}
        wrong = [
            f"{alarm} was {state} and is {shown.get(alarm, 'normal')}"
            for alarm, state in newest.items()
            if shown.get(alarm, "normal") != state
        ]
        if not wrong:
            return []
        time.sleep(0.05)  # a block may have come between the two questions
    return wrong


def _newest_states(api: Api) -> dict[str, str]:
    states: dict[str, str] = {}
    before = ""
    for _ in range(20):
        page = api.get(f"/api/v1/alarms/events?limit=500{before}")
        for event in page["events"]:
            states.setdefault(event["alarm"], event["state_after"])
        if page["next_before"] is None:
            break
        before = f"&before={page['next_before']}"
    return states


def act(api: Api, number: int, watch: Watch) -> None:
    """Be an operator: acknowledge everything, now and then shelve something."""
    try:
        for alarm in api.get("/api/v1/alarms")["alarms"]:
            path = f"/api/v1/alarms/{alarm['id']}"
            if not alarm["is_acknowledged"]:
                api.post(f"{path}/acknowledge", {"actor": "H", "occurrence": alarm["occurrence"]})
                watch.promised.add((alarm["id"], "acknowledged", alarm["occurrence"]))
        if number % 3 == 2:
            _shelve(api, number, watch)
    except (*UNREACHABLE, RefusedError):
        return  # what was not answered was not promised


def _shelve(api: Api, number: int, watch: Watch) -> None:
    """Shelve what the ledger does not look at, each time something else."""
    alarm = f"U1:{BEARINGS[number // 3 % len(BEARINGS)].lower()}_bearing_x:channel_not_ok"
    what = {"actor": "H", "reason": "torture", "duration_s": 3600.0}
    found = api.post(f"/api/v1/alarms/{alarm}/shelve", what)
    watch.promised.add((alarm, "shelved", found["occurrence"]))
