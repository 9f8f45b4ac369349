"""A second service on the same data would be let in by the database without a word."""

import signal
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

Start = Callable[..., Awaitable[Any]]


async def test_a_second_service_on_the_same_data_is_refused_and_the_first_goes_on(
    start: Start, demo_file: Path, tmp_path: Path
) -> None:
    plant = tmp_path / "plant.toml"
    text = demo_file.read_text(encoding="utf-8").replace("var/demo", str(tmp_path / "data"))
    plant.write_text(text.replace("port = 0", "port = 9"), encoding="utf-8")  # nobody answers there
    first = await start("run", str(plant), "--port", "0")
    await first.wait_for_url()

    second = await start("run", str(plant), "--port", "0")
    code = await second.process.wait()
    await second.end(0)

    assert code == 1
    assert second.errors.count("\n") == 1
    assert f"another padwatch (process {first.pid}) works with {tmp_path / 'data'}" in second.errors
    assert (await first.get("/api/v1/overview"))["plant"]["name"]

    await first.end(signal.SIGKILL)
    third = await start("run", str(plant), "--port", "0")
    assert await third.wait_for_url()
