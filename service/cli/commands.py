"""The commands of `padwatch`."""

import typer

from service.cli import audit, config, notifications, probe, recording, reference
from service.cli.accounts import keys_app, users_app
from service.cli.backtest import backtest
from service.cli.daq import daq
from service.cli.options import CommandGroup
from service.cli.reanalyse import reanalyse
from service.cli.record import record
from service.cli.replay import replay
from service.cli.run import acquire, analyse, demo, run, serve
from service.cli.store import backup, readings_app, restore, store_app
from service.cli.validate import validate
from service.runtime.process import set_up_logging

app = typer.Typer(
    cls=CommandGroup,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # as markup, a word in brackets would vanish from a help text or end it
)
for command in (
    *(run, demo, acquire, analyse, serve, daq, record, replay),
    *(reanalyse, backtest, validate, backup, restore),
):
    app.command()(command)
app.add_typer(config.app, name="config")
app.add_typer(reference.app, name="reference")
app.add_typer(audit.app, name="audit")
app.add_typer(recording.app, name="recording")
app.add_typer(store_app, name="store")
app.add_typer(readings_app, name="readings")
app.add_typer(probe.app, name="probe")
app.add_typer(notifications.app, name="delivery")
app.add_typer(users_app, name="users")
app.add_typer(keys_app, name="keys")


@app.callback()
def padwatch() -> None:
    """Oil-film stiffness of hydrogenerator guide bearings, measured while the machine runs."""
    set_up_logging()
