"""The ledger DAQ: a process of its own that nobody kills, and which logs what it has offered.

``python -m harness.ledger_daq FILE PLANT`` with a plant as JSON: serves a block ring over Modbus
TCP for every unit, says on its first line where, takes the commands of ``padwatch daq --control``
on its standard input and ends with it. Into FILE goes one line for every slot that it offers.
"""

import dataclasses
import json
import signal
import subprocess
import sys
import time
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import uvloop

from acquisition.clock import SystemClock
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice, RingDeviceSettings
from acquisition.simulated.feed import Ledger
from harness.ledger_plant import LedgerFeed, LedgerPlant
from harness.tape import environment, python
from service.app.simulated_daq import run_daq
from service.cli.daq import FastClock


class OfferedLog(Ledger):
    """Writes a line for all that is offered: unit, epoch, first index, number, host's time."""

    def __init__(self, file: IO[str]) -> None:
        super().__init__()
        self._file = file
        self._next: dict[tuple[str, int], int] = defaultdict(int)

    def offer(self, unit: str, epoch: int, n_samples: int) -> None:
        """Book samples."""
        first = self._next[unit, epoch]
        self._next[unit, epoch] = first + n_samples
        self._file.write(f"{unit} {epoch} {first} {n_samples} {time.time_ns()}\n")
        self._file.flush()


def main() -> None:
    """Serve until the standard input ends."""
    plant = LedgerPlant(**json.loads(sys.argv[2]))
    clock = FastClock(SystemClock(), 1.0 + 1e-6 * plant.drift_ppm)
    with Path(sys.argv[1]).open("w", encoding="ascii") as file:
        ledger = OfferedLog(file)
        t0_ns = time.time_ns() // 1_000_000 * 1_000_000
        file.write(f"t0 {t0_ns}\n")
        servers = {}
        for number, unit in enumerate(plant.units, start=1):
            settings = RingDeviceSettings(
                samples_per_slot=plant.slot_samples, n_slots=plant.n_slots
            )
            device = RingDevice(LedgerFeed(plant, number, t0_ns), unit, settings, ledger)
            device.identification = {0: b"Ledger", 1: unit.encode("ascii"), 2: b"1"}
            servers[unit] = ModbusTcpServer(device, clock)
        uvloop.run(run_daq(servers, lambda line: print(line, flush=True), controlled=True))


@dataclass
class Offered:
    """What has been offered, read from the log."""

    t0_ns: int
    samples: dict[tuple[str, int], int]
    """Per channel, by unit and epoch: all from 0 on."""

    slots: dict[tuple[str, int], list[tuple[int, int]]]
    """First sample after each slot, and when the slot was offered by the host's clock."""

    def offered_ns(self, unit: str, stop: int, epoch: int = 1) -> int:
        """When the last sample before this one was offered."""
        slots = self.slots[unit, epoch]
        at = bisect_left(slots, (stop, 0))
        return slots[min(at, len(slots) - 1)][1]


class LedgerDaq:
    """A running ledger DAQ."""

    def __init__(
        self, process: "subprocess.Popen[str]", log: Path, ports: Mapping[str, int]
    ) -> None:
        self.process, self.log, self.ports = process, log, ports

    def offered(self) -> Offered:
        """What it has offered so far."""
        lines = self.log.read_text(encoding="ascii").splitlines()
        found = Offered(int(lines[0].split()[1]), {}, defaultdict(list))
        for line in lines[1:]:
            words = line.split()
            if len(words) < 5:
                break  # the line that is being written
            unit, epoch, first, n, at_ns = words[0], *map(int, words[1:5])
            found.samples[unit, epoch] = max(found.samples.get((unit, epoch), 0), first + n)
            found.slots[unit, epoch].append((first + n, at_ns))
        return found

    def stop_answering(self) -> None:
        """Fall silent with the connection open; what is sampled meanwhile comes late or never."""
        self.process.send_signal(signal.SIGSTOP)

    def answer_again(self) -> None:
        """Go on."""
        self.process.send_signal(signal.SIGCONT)

    def tell(self, command: str) -> None:
        """Let it do something wrong: ``UNIT FAULT [COUNT]``."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(command + "\n")
        self.process.stdin.flush()
        answer = json.loads(self.process.stdout.readline())
        assert "done" in answer, answer


@contextmanager
def ledger_daq(plant: LedgerPlant, folder: Path) -> Iterator[LedgerDaq]:
    """Run one, until the end of the block or of this process."""
    log = folder / "offered.txt"
    process = subprocess.Popen(
        python("-m", "harness.ledger_daq", log, json.dumps(dataclasses.asdict(plant))),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    try:
        assert process.stdout is not None
        found = json.loads(process.stdout.readline())
        yield LedgerDaq(process, log, {unit: int(at["port"]) for unit, at in found.items()})
    finally:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:  # a machine that has no time for it
            process.kill()
            process.wait()
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()


if __name__ == "__main__":
    main()
