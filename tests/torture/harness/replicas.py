"""A plant whose results lie in PostgreSQL: processes that bring results, and two that serve."""

import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from harness.kill_cycles import act
from harness.ledger_daq import LedgerDaq
from harness.ledger_plant import LedgerPlant
from harness.nats_server import NatsServer
from harness.postgres_server import PostgresServer
from harness.service_rig import PATIENCE_S, ServiceRig
from harness.watch import Watch

STREAM = """
[stream]
servers = [{servers}]
replicas = 3
max_gb = 1.0
silent_after_s = 5.0
"""

SERVING = {"serve1": ("serve",), "serve2": ("serve",)}
SINGLE = {"run": ("run",), **SERVING}
CHAIN = {
    "acquire": ("acquire",),
    "analyse1": ("analyse", "--partition", "1/2"),
    "analyse2": ("analyse", "--partition", "2/2"),
    **SERVING,
}

STORE = """
[store]
postgresql = "{conninfo}"
"""


@dataclass
class Replicas:
    """All processes of a plant but its DAQ.

    Parameters
    ----------
    rigs
        Processes by role: ``run``, ``acquire``, ``analyse`` and ``serve``, which people ask.
    watches
        One for each process that serves.
    lives
        For each unit, the number of the newest sample offered as one began that knew nothing.
    """

    plant: LedgerPlant
    plant_file: Path
    daq: LedgerDaq
    postgres: PostgresServer
    rigs: Mapping[str, list[ServiceRig]]
    watches: list[Watch]
    nodes: Sequence[NatsServer]
    lives: dict[str, list[int]] = field(default_factory=dict)

    @property
    def serving(self) -> list[ServiceRig]:
        """Those that people ask."""
        return self.rigs["serve"]

    @property
    def working(self) -> list[ServiceRig]:
        """Those that bring results."""
        return [rig for role, rigs in self.rigs.items() for rig in rigs if role != "serve"]

    def start(self) -> None:
        """Start all, those that serve last."""
        self._note_life()
        _start(self.working)
        for rig, watch in zip(self.serving, self.watches, strict=True):
            _start([rig])
            watch.begin(rig.url)

    def kill(self, role: str, number: int) -> None:
        """Kill one process of a role, perhaps while people ask it; it is started again."""
        at = number % len(self.rigs[role])
        rig, watches = self.rigs[role][at], self.watches[at : at + 1] if role == "serve" else []
        rig.kill()
        for watch in watches:
            watch.end()
        if role == "run":  # it knows nothing of the samples before; over a stream others do
            self._note_life()
        _start([rig])
        for watch in watches:
            watch.begin(rig.url)

    def kill_node(self, number: int) -> None:
        """Kill one of three servers of the stream; it is started again."""
        node = self.nodes[number % len(self.nodes)]
        node.kill()
        node.start()

    def restart_postgres(self, number: int) -> None:
        """Restart the database: every other time as after a power cut."""
        self.postgres.restart("immediate" if number % 2 else "fast")

    def act(self, number: int) -> None:
        """Be an operator at one of those that serve."""
        rig, watch = self.serving[number % 2], self.watches[number % 2]
        with rig.api() as api:
            act(api, number, watch)

    def supervise(self) -> None:
        """Start what has ended by itself: who lost the database may not go on analysing."""
        for rig in self.working:
            if rig.process is not None and rig.process.poll() is not None:
                rig.kill()
                _start([rig])

    def wait_for_result(self) -> None:
        """Wait until a result is shown that nobody has seen yet."""
        end_s = time.monotonic() + PATIENCE_S
        for watch in self.watches:
            n_before = watch.n_shown
            while watch.n_shown == n_before:
                self.supervise()
                if time.monotonic() > end_s:
                    raise AssertionError(f"no result: {self.working[-1].newest_log()}")
                time.sleep(0.05)

    def stop(self) -> None:
        """Let everything come to its end in good order."""
        for rig, watch in zip(self.serving, self.watches, strict=True):
            rig.stop()
            watch.end()
        for rig in self.working:
            rig.stop()

    def whole_watch(self) -> Watch:
        """What all clients together were shown and promised."""
        whole = Watch(self.plant)
        for watch in self.watches:
            for key, values in watch.shown.items():
                whole.shown[key].update(values)
            whole.events |= watch.events
            whole.promised |= watch.promised
            whole.n_answers += watch.n_answers
        return whole

    def _note_life(self) -> None:
        for (unit, _), n in self.daq.offered().samples.items():
            self.lives.setdefault(unit, []).append(n)


def _start(rigs: Sequence[ServiceRig]) -> None:
    """Start some processes, and wait until all are ready."""
    for rig in rigs:
        rig.start()
    for rig in rigs:
        rig.wait_ready()


@contextmanager
def replicas(
    plant: LedgerPlant,
    folder: Path,
    daq: LedgerDaq,
    postgres: PostgresServer,
    nodes: Sequence[NatsServer],
) -> Iterator[Replicas]:
    """Processes over PostgreSQL, each with a folder of its own, as on a host of its own.

    Parameters
    ----------
    nodes
        Of a stream between those that acquire and those that analyse; one process does both if
        there are none.
    """
    extra = STORE.format(conninfo=postgres.create("plant"))
    if nodes:
        extra += STREAM.format(servers=", ".join(f'"{node.url}"' for node in nodes))
    rigs: dict[str, list[ServiceRig]] = defaultdict(list)
    with ExitStack() as running:
        for name, role in (CHAIN if nodes else SINGLE).items():
            own = plant.write(folder / f"{name}.toml", folder / name, daq.ports, extra)
            rig = ServiceRig(own, role=role, log=f"{name}.log")
            rigs[role[0]].append(running.enter_context(rig))
        watches = [Watch(plant) for _ in rigs["serve"]]
        for watch in watches:
            running.callback(watch.end)
        yield Replicas(plant, folder / "serve1.toml", daq, postgres, rigs, watches, nodes)
