"""`padwatch delivery`: test a receiver, and retry messages that it refused."""

import asyncio
import json
from collections.abc import Sequence
from contextlib import closing
from typing import Annotated

import typer
import uvloop

from acquisition.clock import SystemClock
from service.app.notifications import composer_of, receivers_of
from service.app.storage import has_store, open_store, store_name
from service.cli.options import PlantPath, fail, read_plant_file
from service.notifications.channel import Delivered, Outcome, Refused
from service.notifications.message import AlarmContext, dumps
from service.notifications.sender import Receiver
from service.settings.plant import PlantFile
from service.settings.storage import Origin
from service.store.port import StoreError

app = typer.Typer(no_args_is_help=True, help="Test receivers of alarms; send again.")

ReceiverId = Annotated[str, typer.Argument(help="Receiver of the plant file.", show_default=False)]
JsonOutput = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@app.command("test")
def send_test(plant_file: PlantPath, receiver: ReceiverId, json_output: JsonOutput = False) -> None:
    """Send a test message now and print the outcome; exit code 1 unless it was accepted.

    It does not go through the outbox: a running service is not disturbed.
    """
    plant = read_plant_file(plant_file)
    chosen = _chosen(plant, receiver)
    outcomes = uvloop.run(_tried(plant, chosen))
    results = [_result(one, outcome) for one, outcome in zip(chosen, outcomes, strict=True)]
    if json_output:
        typer.echo(json.dumps(results, ensure_ascii=False))
    else:
        for found in results:
            typer.echo(f"{found['receiver']}: {found['outcome']}: {found['answer']}")
    if not all(isinstance(outcome, Delivered) for outcome in outcomes):
        raise typer.Exit(1)


@app.command("retry")
def send_again(
    plant_file: PlantPath, receiver: ReceiverId, json_output: JsonOutput = False
) -> None:
    """Queue messages again that a receiver refused or that expired, in their old order.

    A running service begins within half a minute.
    """
    plant = read_plant_file(plant_file)
    names = [one.name for one in _chosen(plant, receiver)]
    if not has_store(plant):
        fail(f"padwatch delivery retry: {store_name(plant)}: there is no such database")
    try:
        with closing(open_store(plant)) as store:
            now_ns = SystemClock().now_ns()
            found = {name: store.outbox.revive(name, now_ns) for name in names}
    except StoreError as error:
        fail(f"padwatch delivery retry: {error}")
    if json_output:
        typer.echo(json.dumps(found))
        return
    for name, n_letters in found.items():
        typer.echo(f"{name}: {n_letters} messages wait again")


async def _tried(plant: PlantFile, chosen: Sequence[Receiver]) -> list[Outcome]:
    message = composer_of(plant, lambda _: AlarmContext()).test(SystemClock().now_ns())
    body = dumps(message)
    return await asyncio.gather(*(one.channel.send(message, body) for one in chosen))


def _result(receiver: Receiver, outcome: Outcome) -> dict[str, str]:
    word = "not delivered"
    if isinstance(outcome, Delivered):
        word = "delivered"
    elif isinstance(outcome, Refused):
        word = "refused"
    return {
        "receiver": receiver.name,
        "address": receiver.channel.address,
        "outcome": word,
        "answer": outcome.answer,
    }


def _chosen(plant: PlantFile, wanted: str) -> list[Receiver]:
    """Return the receivers of one entry of the plant file, or one of its recipients."""
    known = receivers_of(plant, Origin.LIVE, SystemClock())
    chosen = [one for one in known if wanted in (one.name, one.name.partition(":")[0])]
    if not chosen:
        names = ", ".join(one.name for one in known) or "none"
        fail(f"padwatch delivery: there is no receiver {wanted}; the plant file has {names}", 2)
    return chosen
