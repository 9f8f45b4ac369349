"""The commands of `padwatch`; the modules of a command are imported when it is used."""

import gc
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from service.cli.options import CommandGroup

COMMANDS = {
    "run": ("run.run", "Acquire, analyse, store and serve a plant until Ctrl-C or SIGTERM."),
    "demo": (
        "run.demo",
        "Show padwatch at work on two simulated 700 MW units behind a real Modbus TCP DAQ.",
    ),
    "acquire": (
        "run.acquire",
        "Read devices and publish their blocks to the stream until Ctrl-C or SIGTERM.",
    ),
    "analyse": (
        "run.analyse",
        "Analyse blocks from the stream and store results until Ctrl-C or SIGTERM.",
    ),
    "serve": (
        "run.serve",
        "Serve a plant that other processes acquire and analyse, until Ctrl-C or SIGTERM.",
    ),
    "daq": (
        "daq.daq",
        "Serve units over the protocols of their sources, at the addresses in the plant file.",
    ),
    "record": ("record.record", "Record a unit's samples exactly as its DAQ delivers them."),
    "replay": (
        "replay.replay",
        "Play recordings through acquisition, analysis, store and dashboard, as if they happened"
        " now.",
    ),
    "reanalyse": (
        "reanalyse.reanalyse",
        "Analyse a recording with the bearings and the analysis settings of a plant file.",
    ),
    "backtest": (
        "backtest.backtest",
        "Learn baselines from past readings, and list the alarms that would have followed.",
    ),
    "validate": (
        "validate.validate",
        "Recompute the published tables and print them beside padwatch's figures.",
    ),
    "backup": (
        "store.backup",
        "Copy the database, also while padwatch runs; verify the copy and remove the oldest ones.",
    ),
    "restore": (
        "store.restore",
        "Replace the database by a copy, while padwatch is stopped; the old one is kept beside it.",
    ),
    "config": ("config.app", "Check a plant file, print its schema or an example."),
    "reference": (
        "reference.app",
        "Set or list references: the probe gaps with the shaft centred.",
    ),
    "audit": ("audit.app", "Verify and export the audit trail."),
    "recording": ("recording.app", "Inspect, verify, export and import recordings."),
    "store": ("store.store_app", "The database: integrity check."),
    "readings": ("store.readings_app", "Export the stored readings of the films."),
    "probe": ("probe.app", "Read a device once and print its data; nothing is stored."),
    "delivery": ("notifications.app", "Test receivers of alarms; send again."),
    "users": ("accounts.users_app", "Accounts of people: add, list, change, remove."),
    "keys": ("accounts.keys_app", "Keys of machines: create, list, revoke."),
}
"""Module and attribute of each command, and the first sentence of its help."""


class Commands(Mapping[str, Any]):
    """The commands by name, each imported when it is looked up."""

    def __getitem__(self, name: str) -> Any:
        """Import a command."""
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


class LazyGroup(CommandGroup):
    """Group of all commands; its own help imports none of them."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        self.commands: Any = Commands()

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the names of the commands and what they do."""
        described = [TyperCommand(name, help=text) for name, (_, text) in COMMANDS.items()]
        TyperGroup(commands=described).format_commands(ctx, formatter)


app = typer.Typer(
    cls=LazyGroup,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # as markup, a word in brackets would vanish from a help text or end it
)


@app.callback()
def padwatch() -> None:
    """Oil-film stiffness of hydrogenerator guide bearings, measured while the machine runs."""
    from service.runtime.process import set_up_logging

    set_up_logging()
