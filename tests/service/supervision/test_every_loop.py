"""Every task of a running service is heard of; a new one that is not fails here."""

import asyncio
import socket
from pathlib import Path
from typing import Any

import httpx2

from acquisition.clock import SystemClock
from service.program import Performance, run_service
from service.settings.loading import load_plant_file
from service.wiring.sources import live_units

NOT_LOOPS = {
    "run",  # only holds those that are: its end is theirs
    "announce",  # ends by itself once the server answers
    "supervise",  # whoever listens to all others; the watchdog listens to it
    "the service",
    "deliver",  # one loop for each receiver, of which this plant has none
}


PATIENCE_S = 20.0


async def _lasting(tasks: set[asyncio.Task[Any]]) -> set[str]:
    """Names of tasks; of those that were given none, what runs in them, unless it soon ends."""
    named = {task for task in tasks if not task.get_name().startswith("Task-")}
    left = tasks - named
    if left:  # as of a connection that is being tried
        _, left = await asyncio.wait(left, timeout=PATIENCE_S)
    return {task.get_name() for task in named} | {str(task.get_coro()) for task in left}


async def test_every_task_of_the_program_has_a_pulse(
    tmp_path: Path, plant_text: str, monkeypatch: Any
) -> None:
    plant = tmp_path / "plant.toml"
    text = plant_text.replace("var/demo", str(tmp_path / "data")).replace("port = 0", "port = 1")
    plant.write_text(text, encoding="utf-8")
    settings, clock = load_plant_file(plant), SystemClock()
    before, said = asyncio.all_tasks(), asyncio.Queue()
    stopped = asyncio.Event()
    monkeypatch.setattr("service.program.stop_on_signals", lambda: stopped)
    listener = socket.create_server(("127.0.0.1", 0))
    performance = Performance(settings, live_units(settings, clock))
    service = asyncio.create_task(
        run_service(performance, listener, clock, said.put_nowait), name="the service"
    )
    url = await asyncio.wait_for(said.get(), 60)
    async with httpx2.AsyncClient(base_url=url, trust_env=False, timeout=60.0) as client:
        answer = await client.get("/readyz")
        nested = await client.post("/api/v1/session", content=b"[" * 20_000 + b"]" * 20_000)
        foreign = await client.get("/livez", headers={"Host": "evil.example"})
    names = await _lasting(asyncio.all_tasks() - before)
    stopped.set()
    await asyncio.wait_for(service, 60)

    heard = {
        name.removeprefix("loop ") for name in answer.json()["checks"] if name.startswith("loop ")
    }
    assert answer.status_code == 200, answer.text
    assert names - NOT_LOOPS <= heard
    assert heard <= names
    assert {"acquire U1", "acquire U2", "analyse", "record", "alarms", "load", "serve"} <= heard
    assert "references" in heard
    assert (nested.status_code, foreign.status_code) == (400, 421)  # its guards are in their places
