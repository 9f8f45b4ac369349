"""Shared parts of commands: arguments, errors, results, progress, and the plant's store."""

import os
import signal
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

if TYPE_CHECKING:
    from service.settings.plant import PlantFile
    from service.settings.units import UnitSettings
    from service.store.access.tables import AccessStore
    from service.store.store import Store


def option(meaning: str, *names: str, **limits: Any) -> Any:
    """Return the declaration of an option whose help shows no default."""
    return typer.Option(*names, help=meaning, show_default=False, **limits)


def argument(meaning: str, **settings: Any) -> Any:
    """Return the declaration of an argument whose help shows no default."""
    return typer.Argument(help=meaning, show_default=False, **settings)


PlantPath = Annotated[Path, argument("The plant file (TOML).")]
PlantOption = Annotated[Path, option("The plant file (TOML).", "--plant")]
UnitOption = Annotated[str | None, option("Unit of the plant file.", "--unit")]
PortOption = Annotated[
    int | None, typer.Option("--port", min=0, max=65535, help="HTTP port instead of the file's.")
]
RecordingFolder = Annotated[Path, argument("Folder of the recording.")]
NewRecording = Annotated[
    Path, typer.Option("--out", help="Folder of the recording; must not exist yet.")
]
JsonOutput = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]

EXIT_CODES = {
    "service.settings.toml_file.TomlFileError": 2,
    "service.store.access.tables.AccessRefusedError": 2,
    "service.store.access.identities.NameRefusedError": 2,
    "service.api.auth.passwords.PasswordRefusedError": 2,
    "service.app.listener.ClosedError": 2,
    "service.runtime.listening.CertificateError": 2,
    "acquisition.errors.AcquisitionError": 1,
    "service.store.port.StoreError": 1,
    "service.store.backup.BackupError": 1,
    "service.cli.offline.backtest_cells.ReadingsError": 1,
    "service.runtime.listening.PortInUseError": 1,
    "service.cluster.session.StreamAnewError": 1,
}
"""Exit codes of expected errors: 2 if a second try would fail too, 1 for a failure of a device,
file, database or port. The names spare each command the modules of errors that it cannot raise."""


class CommandError(Exception):
    """Failure of a command, with an exit code; the message is printed after the command's name."""

    def __init__(self, message: str, code: int = 1) -> None:
        super().__init__(message)
        self.code = code


class CommandGroup(TyperGroup):
    """Group of commands; an expected error ends its command with a message and an exit code."""

    def invoke(self, ctx: Any) -> Any:
        """Run the chosen command; print an expected error and exit with its code (`EXIT_CODES`)."""
        try:
            return super().invoke(ctx)
        except CommandError as error:
            _end(f"{_command_name(ctx)}: {error}", error.code)
        except Exception as error:
            names = [f"{kind.__module__}.{kind.__name__}" for kind in type(error).__mro__]
            code = next((EXIT_CODES[name] for name in names if name in EXIT_CODES), None)
            if code is None:
                raise
            is_plant_file = "service.settings.toml_file.TomlFileError" in names
            _end(str(error) if is_plant_file else f"{_command_name(ctx)}: {error}", code)


def _command_name(ctx: Any) -> str:
    names = [ctx.invoked_subcommand]
    while ctx.parent is not None:
        names.append(ctx.info_name)
        ctx = ctx.parent
    return " ".join(["padwatch", *reversed(names)])


def _end(message: str, code: int) -> NoReturn:
    typer.echo(message, err=True)
    raise typer.Exit(code) from None


def command_group(meaning: str) -> typer.Typer:
    """Return a new group of commands with the help text `meaning`."""
    return typer.Typer(no_args_is_help=True, help=meaning, cls=CommandGroup)


def fail(message: str, code: int = 1) -> NoReturn:
    """Raise `CommandError`, which ends the command with a message and an exit code."""
    raise CommandError(message, code)


def print_result(
    document: object, lines: Iterable[str], json_output: bool, indent: int | None = 1
) -> None:
    """Print `document` as JSON, in one line if `indent` is None, or the text `lines`."""
    from pydantic_core import to_json

    shown = (
        [to_json(document, indent=indent, inf_nan_mode="null").decode()] if json_output else lines
    )
    for line in shown:
        typer.echo(line)


def progress(label: str, length: int) -> Any:
    """Return a progress bar of `length` steps on standard error, shown only on a terminal.

    The bar is a context manager; its `update` adds steps.
    """
    return typer.progressbar(
        length=length, label=label, file=sys.stderr, hidden=not sys.stderr.isatty()
    )


@contextmanager
def plant_store(plant: "PlantFile", creates: bool = False) -> Iterator["Store"]:
    """Open the plant's database, yield its store, and close it.

    Parameters
    ----------
    creates
        Whether a missing database is created; this is reported on standard error.

    Raises
    ------
    CommandError
        If the database does not exist and is not created.
    """
    from service.app.storage import has_store, open_store, store_name

    _require(has_store(plant), store_name(plant), creates)
    with closing(open_store(plant)) as store:
        yield store


@contextmanager
def plant_access(plant: "PlantFile", creates: bool = False) -> Iterator["AccessStore"]:
    """Open the database of accounts and keys (`creates`: also create it); yield its store."""
    from service.app.storage import ACCESS_DATABASE, has_store, open_access, store_name

    _require(has_store(plant, ACCESS_DATABASE), store_name(plant, ACCESS_DATABASE), creates)
    with closing(open_access(plant)) as store:
        yield store


def _require(is_there: bool, name: str, creates: bool) -> None:
    """Report a missing database: the data folder may be relative to another folder."""
    if is_there:
        return
    if not creates:
        fail(f"{name}: the database does not exist; check data_folder and the working directory")
    typer.echo(f"{name}: created a new database; check that the service uses it", err=True)


def one_unit(plant: "PlantFile", id_: str | None, path: Path) -> "UnitSettings":
    """Return the unit `id_`, or for None the only unit of the plant file at `path`.

    Raises `CommandError` with exit code 2 for an unknown unit, or for None with several units.
    """
    known = ", ".join(unit.id for unit in plant.unit)
    if id_ is None and len(plant.unit) > 1:
        fail(f"{path}: choose one of the units {known} with --unit", code=2)
    chosen = [unit for unit in plant.unit if id_ in (unit.id, None)]
    if not chosen:
        fail(f"{path}: unknown unit {id_}; known units: {known}", code=2)
    return chosen[0]


@contextmanager
def terminal_to_itself() -> Iterator[None]:
    """Put this process in the foreground of the terminal, so that Ctrl-C reaches only it.

    Under ``make``, Ctrl-C would also reach make, which then reports a normal exit as an error.
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


def password_from(descriptor: int | None) -> str:
    """Read a new password from a file descriptor, or for None ask for it on the terminal.

    A final line end is removed. Raises `CommandError` with exit code 2 if there is no
    terminal, or if the descriptor is unreadable, not UTF-8 or has more than `MAX_BYTES` bytes.
    """
    if descriptor is None:
        if not sys.stdin.isatty():
            fail("no terminal for the password prompt; use --password-fd", 2)
        asked: str = typer.prompt("Password", hide_input=True, confirmation_prompt=True)
        return asked
    found = b""
    try:
        while len(found) <= MAX_BYTES and (more := os.read(descriptor, MAX_BYTES)):
            found += more
        if len(found) > MAX_BYTES:
            fail(f"the password from descriptor {descriptor} is longer than {MAX_BYTES} bytes", 2)
        return found.decode().removesuffix("\n").removesuffix("\r")
    except OSError as error:
        fail(f"cannot read the password from descriptor {descriptor}: {error.strerror}", 2)
    except UnicodeDecodeError:
        fail(f"the password from descriptor {descriptor} is not UTF-8 text", 2)


DEMO = "demo.toml"
DEMO_LIFE = "demo-life.toml"
EXAMPLE = "plant.toml"

PACKAGED = Path(sysconfig.get_path("data")) / "share" / "padwatch"
"""Folder of the example files in an installed package."""

CHECKOUT = Path(__file__).parent.parent.parent / "deploy"
"""Folder of the example files in a checkout."""


def example_path(name: str) -> Path:
    """Return the path of the example plant file `name`, in the checkout or else in the package."""
    return next(path for path in (CHECKOUT / name, PACKAGED / name) if path.exists())
