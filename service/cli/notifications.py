"""`padwatch delivery`: test a receiver, and retry messages that it refused."""

import asyncio
from collections.abc import Sequence
from typing import Annotated

import typer
import uvloop

from acquisition.clock import SystemClock
from service.app.notifications import composer_of, receivers_of
from service.cli.options import (
    JsonOutput,
    PlantPath,
    argument,
    command_group,
    fail,
    plant_store,
    print_result,
)
from service.notifications.channel import Delivered, Outcome, Refused
from service.notifications.message import AlarmContext, dumps
from service.notifications.sender import Receiver
from service.settings.plant import PlantFile, load_plant_file
from service.settings.storage import Origin

app = command_group("Test receivers of alarms, and resend messages.")

ReceiverId = Annotated[str, argument("Receiver of the plant file.")]


@app.command("test")
def send_test(plant_file: PlantPath, receiver: ReceiverId, json_output: JsonOutput = False) -> None:
    """Send a test message to a receiver now and print the outcome; exit code 1 after a refusal.

    The message bypasses the outbox, so that a running service is not disturbed.
    """
    plant = load_plant_file(plant_file)
    chosen = _chosen(plant, receiver)
    outcomes = uvloop.run(_send_to(plant, chosen))
    results = [_result(one, outcome) for one, outcome in zip(chosen, outcomes, strict=True)]
    lines = [f"{found['receiver']}: {found['outcome']}: {found['answer']}" for found in results]
    print_result(results, lines, json_output, indent=None)
    if not all(isinstance(outcome, Delivered) for outcome in outcomes):
        raise typer.Exit(1)


@app.command("retry")
def send_again(
    plant_file: PlantPath, receiver: ReceiverId, json_output: JsonOutput = False
) -> None:
    """Requeue the refused and expired messages of a receiver, in their original order.

    A running service begins to send them within half a minute.
    """
    plant = load_plant_file(plant_file)
    names = [one.name for one in _chosen(plant, receiver)]
    with plant_store(plant) as store:
        now_ns = SystemClock().now_ns()
        found = {name: store.outbox.revive(name, now_ns) for name in names}
    lines = [f"{name}: {n} messages are queued again" for name, n in found.items()]
    print_result(found, lines, json_output, indent=None)


async def _send_to(plant: PlantFile, chosen: Sequence[Receiver]) -> list[Outcome]:
    message = composer_of(plant, lambda _: AlarmContext()).test(SystemClock().now_ns())
    body = dumps(message)
    return await asyncio.gather(*(one.channel.send(message, body) for one in chosen))


def _result(receiver: Receiver, outcome: Outcome) -> dict[str, str]:
    words = {Delivered: "delivered", Refused: "refused"}
    return {
        "receiver": receiver.name,
        "address": receiver.channel.address,
        "outcome": words.get(type(outcome), "not delivered"),
        "answer": outcome.answer,
    }


def _chosen(plant: PlantFile, wanted: str) -> list[Receiver]:
    """Return the receivers of one entry of the plant file, or one of its recipients."""
    known = receivers_of(plant, Origin.LIVE, SystemClock())
    chosen = [one for one in known if wanted in (one.name, one.name.partition(":")[0])]
    if not chosen:
        names = ", ".join(one.name for one in known) or "none"
        fail(f"unknown receiver {wanted}; known receivers: {names}", 2)
    return chosen
