"""Everything a program asks of its disk, in order, as strace sees it."""

import os
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[3]

CALLS = (
    "openat,write,pwrite64,ftruncate,fsync,fdatasync,unlink,unlinkat,rename,renameat,renameat2,"
    "mkdir,link,symlink,writev,pwritev,truncate,fallocate,sync_file_range,mmap"
)
STRACE = ("strace", "-f", "-qq", "-xx", "-y", "-s", "10000000")


class Made(NamedTuple):
    """A file that was not there."""

    name: str


class Written(NamedTuple):
    """Bytes at a place in a file."""

    name: str
    offset: int
    data: bytes


class Cut(NamedTuple):
    """A file made so long."""

    name: str
    size: int


class Synced(NamedTuple):
    """A file, or the folder, brought to the disk."""

    name: str


class Renamed(NamedTuple):
    """A file under another name."""

    old: str
    new: str


class Removed(NamedTuple):
    """A name that is no more."""

    name: str


class Acknowledged(NamedTuple):
    """The program said of a transaction that it is durable."""

    number: int


Step = Made | Written | Cut | Synced | Renamed | Removed | Acknowledged

_LINE = re.compile(r"^\d+ +(\w+)\((.*)\) += (-?\d+)")
_FD = re.compile(r"(\d+)<([^>]*)>")
_TEXT = re.compile(r'"((?:\\x[0-9a-f]{2})*)"')


def record(
    command: Sequence[str], folder: Path, tape: Path, environment: Mapping[str, str]
) -> list[Step]:
    """Run a program under strace and return what it did to the files of a folder.

    Parameters
    ----------
    command
        Of a program with one thread, which writes the number of a transaction into the file
        ``acks``, outside the folder, once it is durable.
    """
    subprocess.run(
        [*STRACE, "-e", f"trace={CALLS}", "-o", str(tape), *command],
        check=True,
        stdout=subprocess.DEVNULL,
        timeout=300,
        env=dict(environment),
    )
    with tape.open(encoding="ascii") as lines:
        return list(_steps(lines, folder))


def _steps(lines: Iterable[str], folder: Path) -> Iterator[Step]:
    offsets: dict[str, int] = {}
    known: set[str] = set()
    for line in lines:
        found = _LINE.match(line)
        if found is None:
            if "exited with" in line or "killed by" in line:
                continue
            raise ValueError(f"not understood: {line[:200]}")
        call, arguments, result = found[1], found[2], int(found[3])
        if result >= 0:
            yield from _step(call, arguments, result, folder, offsets, known)


def _step(
    call: str, arguments: str, result: int, folder: Path, offsets: dict[str, int], known: set[str]
) -> Iterator[Step]:
    texts = [bytes.fromhex(text.replace("\\x", "")) for text in _TEXT.findall(arguments)]
    if call == "openat":
        name = _within(texts[0].decode(), folder)
        if name is None or "O_CREAT" not in arguments:
            return
        if name not in known:
            yield Made(name)
        elif "O_TRUNC" in arguments:
            yield Cut(name, 0)
        known.add(name)
        offsets[name] = 0
        return
    if call in ("unlink", "rename"):
        names = [_within(text.decode(), folder) for text in texts]
        if None in names:
            return
        yield Removed(names[0]) if call == "unlink" else Renamed(names[0], names[1])  # type: ignore[arg-type]
        known.discard(names[0])  # type: ignore[arg-type]
        if call == "rename":
            known.add(names[1])  # type: ignore[arg-type]
        return
    file = _FD.match(arguments)
    path = "" if file is None else bytes.fromhex(file[2].replace("\\x", "")).decode()
    if call == "write" and Path(path).name == "acks":
        yield Acknowledged(int(texts[0]))
        return
    name = _within(path, folder)
    if name is None or name.endswith("-shm"):
        return  # what is shared by processes only; rebuilt after a crash
    if call == "write":
        yield Written(name, offsets[name], texts[0][:result])
        offsets[name] += result
    elif call == "pwrite64":
        yield Written(name, int(arguments.rpartition(",")[2]), texts[0][:result])
    elif call == "ftruncate":
        yield Cut(name, int(arguments.rpartition(",")[2]))
    elif call in ("fsync", "fdatasync"):
        yield Synced(name)
    elif call != "mmap":
        raise ValueError(f"a call that is not modelled: {call}({arguments[:100]})")


def _within(path: str, folder: Path) -> str | None:
    """Name within the folder; "" for the folder itself, None for what is elsewhere."""
    full = path if path.startswith("/") else str(Path.cwd() / path)
    if full == str(folder):
        return ""
    name = full.removeprefix(f"{folder}/")
    return None if name == full else name


def python(*arguments: object) -> list[str]:
    """Build the command line of a Python program."""
    return [sys.executable, *map(str, arguments)]


def environment() -> dict[str, str]:
    """Return the environment in which a program finds padwatch, this package and the rigs."""
    folders = (ROOT, ROOT / "tests" / "torture", ROOT / "tests" / "contract")
    return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, folders))}
