"""What a service manager hears from the program, and what `/readyz` says of its loops."""

import socket
from pathlib import Path
from typing import Any

import httpx2
import pytest

LOOPS = {"analyse", "record", "references", "alarms", "captures", "evidence", "learn", "serve"}


async def test_the_service_manager_is_told_from_the_start_to_the_end(
    start: Any, demo_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(tmp_path / "notify"))
        manager.settimeout(60.0)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "200000")
        monkeypatch.delenv("WATCHDOG_PID", raising=False)
        plant = tmp_path / "plant.toml"
        text = demo_file.read_text(encoding="utf-8").replace("port = 0", "port = 1")
        plant.write_text(text.replace("var/demo", str(tmp_path / "data")), encoding="utf-8")
        program = await start("run", str(plant), "--port", "0")
        url = await program.wait_for_url()
        told = [manager.recv(4096).decode() for _ in range(6)]
        async with httpx2.AsyncClient(base_url=url, trust_env=False) as client:
            checks = (await client.get("/readyz")).json()["checks"]
        assert await program.end() == 0
        while not told[-1].startswith("STOPPING=1"):
            told.append(manager.recv(4096).decode())

    status = "STATUS=0 of 2 units connected"
    assert f"READY=1\n{status}" in told
    assert told.count(f"WATCHDOG=1\n{status}") >= 5
    assert told[-1] == "STOPPING=1\nSTATUS=stopping"
    loops = {name.removeprefix("loop ") for name in checks if name.startswith("loop ")}
    assert loops == LOOPS
    assert {checks[f"loop {name}"] for name in loops} == {"alive"}
