"""Commands of `padwatch`; the modules of a command are imported when it is used."""

import gc
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from service.cli.options import CommandGroup

GROUPS = {
    "Run": {
        "run": ("run.run", "Acquire, analyse, store and serve a plant until Ctrl-C or SIGTERM."),
        "demo": (
            "processes.demo",
            "Run padwatch with two simulated 700 MW units, read from simulated DAQs by Modbus TCP.",
        ),
        "daq": (
            "daq.daq",
            "Run simulated DAQs of the units, with the protocols and addresses in the plant file.",
        ),
    },
    "Set up": {
        "config": ("config.app", "Check a plant file, print its schema or an example."),
        "probe": ("probe.app", "Read a device once and print its data; nothing is stored."),
        "reference": (
            "reference.app",
            "Set or list references: the probe gaps with the shaft centred.",
        ),
        "delivery": ("notifications.app", "Test receivers of alarms, and resend messages."),
        "users": ("accounts.users_app", "Accounts of people: add, list, change, remove."),
        "keys": ("accounts.keys_app", "API keys: create, list, revoke."),
    },
    "Recordings and readings": {
        "record": ("record.record", "Record a unit's samples exactly as its DAQ delivers them."),
        "recording": ("recording.app", "Inspect, verify, export and import recordings."),
        "reanalyse": (
            "reanalyse.reanalyse",
            "Analyse a recording with the bearings and the analysis settings of a plant file.",
        ),
        "replay": (
            "replay.replay",
            "Play recordings through acquisition, analysis, store and dashboard, as if they"
            " happened now.",
        ),
        "readings": ("store.readings_app", "Export the stored readings of the films."),
        "backtest": (
            "backtest.backtest",
            "Learn baselines from past readings, and list the alarms that would have followed.",
        ),
    },
    "Maintain": {
        "backup": (
            "store.backup",
            "Copy the databases of results and accounts, also while padwatch runs; verify the"
            " copies.",
        ),
        "restore": (
            "store.restore",
            "Replace the databases by copies while padwatch is stopped; the old databases"
            " are kept.",
        ),
        "store": ("store.store_app", "The databases: integrity check."),
        "audit": ("audit.app", "Verify and export the audit trail."),
        "validate": (
            "validate.validate",
            "Recompute the tables of the paper; print published and computed figures.",
        ),
    },
    "Run as several processes": {
        "acquire": (
            "processes.acquire",
            "Read devices and publish their blocks to the stream until Ctrl-C or SIGTERM.",
        ),
        "analyse": (
            "processes.analyse",
            "Analyse blocks from the stream and store results until Ctrl-C or SIGTERM.",
        ),
        "serve": (
            "processes.serve",
            "Serve a plant that other processes acquire and analyse, until Ctrl-C or SIGTERM.",
        ),
    },
}
"""Commands by heading of the help: name, then module and attribute, and first sentence."""

COMMANDS = {name: entry for group in GROUPS.values() for name, entry in group.items()}


class Commands(Mapping[str, Any]):
    """Mapping of the commands by name, which imports the module of a command at its first use."""

    def __getitem__(self, name: str) -> Any:
        """Import the module of a command and return it; raises `KeyError` for an unknown name."""
        module, attribute = COMMANDS[name][0].split(".")
        gc.disable()  # a hundred collections take a fifth of the loading time
        found = getattr(import_module(f"service.cli.{module}"), attribute)
        gc.enable()
        parent = typer.Typer(rich_markup_mode=None, add_completion=False)
        if isinstance(found, typer.Typer):
            parent.add_typer(found, name=name)
        else:
            parent.command(name)(found)
        parent.callback()(padwatch)  # makes the parent of a single command a group
        return typer.main.get_group(parent).commands[name]

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names, in the order of the help."""
        return iter(COMMANDS)

    def __len__(self) -> int:
        """Return the number of commands."""
        return len(COMMANDS)


class _LazyGroup(CommandGroup):
    """Group of all commands; its help text is printed without importing their modules."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = Commands()

    def format_commands(self, _: Any, formatter: Any) -> None:
        """Write the names and help texts of the commands, by group."""
        width = max(map(len, COMMANDS))
        for heading, group in GROUPS.items():
            texts = {name: TyperCommand(name, help=text) for name, (_, text) in group.items()}
            limit = formatter.width - 6 - width
            with formatter.section(heading):
                formatter.write_dl(
                    [(name.ljust(width), c.get_short_help_str(limit)) for name, c in texts.items()]
                )


app = typer.Typer(
    cls=_LazyGroup,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # as markup, a word in brackets would vanish from a help text or end it
)


def _print_version(is_wanted: bool) -> None:
    """Print the version of the program and exit, if the option ``--version`` was given."""
    if is_wanted:
        from importlib.metadata import version

        typer.echo(f"padwatch {version('padwatch')}")
        raise typer.Exit


@app.callback()
def padwatch(
    version: Annotated[  # noqa: ARG001
        bool,
        typer.Option(
            "--version", help="Print the version.", callback=_print_version, is_eager=True
        ),
    ] = False,
) -> None:
    """Oil-film stiffness of hydrogenerator guide bearings, measured while the machine runs."""
    from service.runtime.process import set_up_logging

    set_up_logging()
