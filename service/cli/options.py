"""Shared arguments of commands: plant file, unit, password, terminal, example files."""

import os
import signal
import sys
import sysconfig
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from service.settings.loading import load_plant_file
from service.settings.plant import PlantFile
from service.settings.processes import StreamSettings
from service.settings.toml_file import TomlFileError
from service.settings.units import UnitSettings

PlantPath = Annotated[Path, typer.Argument(help="The plant file (TOML).", show_default=False)]


def read_plant_file(path: Path) -> PlantFile:
    """Read a plant file, or end with exit code 2 and a line for each mistake."""
    try:
        return load_plant_file(path)
    except TomlFileError as error:
        fail(str(error), code=2)


def fail(message: str, code: int = 1) -> NoReturn:
    """End the command with a message."""
    typer.echo(message, err=True)
    raise typer.Exit(code)


UnitOption = Annotated[
    str | None, typer.Option("--unit", help="Unit of the plant file.", show_default=False)
]


def one_unit(plant: PlantFile, id_: str | None, path: Path) -> UnitSettings:
    """Return a unit, or end with exit code 2; the name of a plant's only unit is optional."""
    known = ", ".join(unit.id for unit in plant.unit)
    if id_ is None and len(plant.unit) > 1:
        fail(f"{path}: has units {known}; choose one with --unit", code=2)
    chosen = [unit for unit in plant.unit if id_ in (unit.id, None)]
    if not chosen:
        fail(f"{path}: has no unit {id_}, it has {known}", code=2)
    return chosen[0]


def stream_settings(plant: PlantFile) -> StreamSettings:
    """Return the plant file's [stream], or end the command."""
    if plant.stream is None:
        fail(
            "padwatch: the plant file has no [stream]: give it one, with the servers of NATS, or"
            " use `padwatch run`, which needs none",
            2,
        )
    return plant.stream


@contextmanager
def terminal_to_itself() -> Iterator[None]:
    """Take the terminal's foreground, so that Ctrl-C reaches this process alone.

    Below ``make``, Ctrl-C would also reach make, which then reports an orderly end as an error.
    Without a terminal, or when the process already leads its group, nothing happens.
    """
    group = os.getpgrp()
    if not sys.stdin.isatty() or group == os.getpid() or os.tcgetpgrp(0) != group:
        yield
        return
    before = signal.signal(signal.SIGTTOU, signal.SIG_IGN)  # else the restore would stop us
    os.setpgid(0, 0)
    os.tcsetpgrp(0, os.getpgrp())
    try:
        yield
    finally:
        os.tcsetpgrp(0, group)
        signal.signal(signal.SIGTTOU, before)


MAX_BYTES = 4096

PasswordFd = Annotated[
    int | None,
    typer.Option(min=0, help="Read the password from this file descriptor instead of asking."),
]


def password_from(descriptor: int | None, command: str) -> str:
    """Read a new password, or end the command with exit code 2."""
    if descriptor is not None:
        return _read(descriptor, command)
    if not sys.stdin.isatty():
        fail(f"{command}: there is no terminal to ask on; use --password-fd", 2)
    asked: str = typer.prompt("Password", hide_input=True, confirmation_prompt=True)
    return asked


def _read(descriptor: int, command: str) -> str:
    found = b""
    try:
        while len(found) <= MAX_BYTES and (more := os.read(descriptor, MAX_BYTES)):
            found += more
    except OSError as error:
        fail(f"{command}: file descriptor {descriptor}: {error.strerror}", 2)
    if len(found) > MAX_BYTES:
        fail(f"{command}: file descriptor {descriptor} holds more than a password", 2)
    try:
        return found.decode().removesuffix("\n").removesuffix("\r")
    except UnicodeDecodeError:
        fail(f"{command}: file descriptor {descriptor} holds no UTF-8 text", 2)


DEMO = "demo.toml"
DEMO_LIFE = "demo-life.toml"
EXAMPLE = "plant.toml"

PACKAGED = Path(sysconfig.get_path("data")) / "share" / "padwatch"
"""Folder of the example files in an installed package."""

CHECKOUT = Path(__file__).parent.parent.parent / "deploy"
"""Folder of the example files in a checkout."""


def example_path(name: str) -> Path:
    """Return the path of an example plant file."""
    return next(path for path in (CHECKOUT / name, PACKAGED / name) if path.exists())
