"""`Disk`: what may be on a disk after a power cut, by what was asked of it before."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from harness.tape import Acknowledged, Cut, Made, Removed, Renamed, Step, Synced, Written

SECTOR_BYTES = 512


@dataclass
class _File:
    """What certainly is on the disk, and what was asked for since."""

    durable: bytearray = field(default_factory=bytearray)
    pending: list[Written | Cut] = field(default_factory=list)

    def sync(self) -> None:
        for asked in self.pending:
            _do(self.durable, asked)
        self.pending.clear()


class Disk:
    """A disk that keeps only what it was told to bring to rest.

    Of writes that were not synced each one is there, not there, or there in some of its sectors;
    names that were made, changed or removed are there up to any one of them. That is more than
    most disks do wrong, and all that POSIX lets them.
    """

    def __init__(self) -> None:
        self._names: dict[str, _File] = {}
        self._durable_names: dict[str, _File] = {}
        self._pending_names: list[dict[str, _File]] = []
        self.acknowledged = -1

    def take(self, steps: Iterable[Step]) -> None:
        """Do what was asked."""
        for step in steps:
            self._take(step)

    def _take(self, step: Step) -> None:
        match step:
            case Made(name):
                self._rename(self._names | {name: _File()})
            case Written(name) | Cut(name):
                self._names[name].pending.append(step)
            case Synced(""):
                self._durable_names = dict(self._names)
                self._pending_names.clear()
            case Synced(name):
                self._names[name].sync()
            case Renamed(old, new):
                names = dict(self._names)
                names[new] = names.pop(old)
                self._rename(names)
            case Removed(name):
                self._rename({n: file for n, file in self._names.items() if n != name})
            case Acknowledged(number):
                self.acknowledged = number

    def _rename(self, names: dict[str, _File]) -> None:
        self._names = names
        self._pending_names.append(names)

    def after_a_cut(self, rng: np.random.Generator) -> dict[str, bytes]:
        """One of the states in which the disk may be found when the power is back."""
        states = [self._durable_names, *self._pending_names]
        names = states[rng.integers(len(states))]
        return {name: _survived(file, rng) for name, file in names.items()}


def _survived(file: _File, rng: np.random.Generator) -> bytes:
    content = bytearray(file.durable)
    for asked in file.pending:
        fate = rng.integers(3)
        if fate == 0:
            continue
        _do(content, asked if fate == 1 or isinstance(asked, Cut) else None)
        if fate == 2 and isinstance(asked, Written):
            for part in _sectors(asked):
                if rng.random() < 0.5:
                    _do(content, part)
    return bytes(content)


def _sectors(asked: Written) -> Iterable[Written]:
    start = asked.offset
    stop = start + len(asked.data)
    while start < stop:
        end = min(stop, (start // SECTOR_BYTES + 1) * SECTOR_BYTES)
        yield Written(asked.name, start, asked.data[start - asked.offset : end - asked.offset])
        start = end


def _do(content: bytearray, asked: Written | Cut | None) -> None:
    match asked:
        case Written(_, offset, data):
            content.extend(b"\0" * (offset - len(content)))
            content[offset : offset + len(data)] = data
        case Cut(_, size):
            content.extend(b"\0" * (size - len(content)))
            del content[size:]
