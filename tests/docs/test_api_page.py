"""Every line of the page about the API is run against a service, as a reader would run it."""

import asyncio
import json
import os
import re
import signal
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx2
import pytest
from rigs.command_line import OPEN

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
ADDRESS = "http://127.0.0.1:8080"
ALARM = "/api/v1/alarms/U1:UJB:oil_temperature"
PATIENCE_S = 240.0
"""Until the test gives up; it does not wait that long when all is well."""

LOOK_EVERY_S = 0.5

SETTINGS = """
[analysis]
segment_samples = 4096
min_segments = 2

[[unit]]"""

LIMIT = """
alarms.oil_temperature_c = { alert = 10.0, on_delay_s = 0.0 }
"""

REFUSALS = "curl() { command curl --fail-with-body --noproxy '*' \"$@\"; }"
"""Lets the shell end with an error where an answer is one."""


def fences(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)


def one_unit(folder: Path) -> Path:
    """The demonstration's first unit, simulated in the service's own process."""
    head, unit = (ROOT / "deploy" / "demo.toml").read_text(encoding="utf-8").split("[[unit]]")[:2]
    before, after = re.split(r"\[unit\.source\][^\[]*", unit, maxsplit=1)
    text = head.replace("var/demo", str(folder / "data")) + SETTINGS + before
    text += '[unit.source]\nkind = "simulated"\n\n' + after
    marked = text.replace('oil_temperature = "ujb_oil_temperature"\n', "\\g<0>", 1)
    assert marked != text
    text = marked.replace("\\g<0>", f'oil_temperature = "ujb_oil_temperature"{LIMIT}')
    path = folder / "plant.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
async def address(tmp_path: Path) -> AsyncIterator[str]:
    """A service that has results, an alarm, and its evidence."""
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", OPEN, "run", str(one_unit(tmp_path)), "--port", "0"),
        stdout=asyncio.subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"},
    )
    try:
        async with asyncio.timeout(PATIENCE_S):
            assert process.stdout is not None
            said = (await process.stdout.readline()).decode()
            url = said.removeprefix("padwatch: ").strip().rstrip("/")
            await until_all_is_there(url)
        yield url
    finally:
        process.send_signal(signal.SIGTERM)
        await process.communicate()  # to the end of the pipe, else uvloop cannot close


async def until_all_is_there(url: str) -> None:
    async with httpx2.AsyncClient(base_url=url, trust_env=False, timeout=PATIENCE_S) as client:

        async def answer(path: str) -> Any:
            response = await client.get(path)
            return response.json() if response.status_code == 200 else {}

        while not (await answer(f"{ALARM}/evidence/1")):
            await asyncio.sleep(LOOK_EVERY_S)
        latest = "/api/v1/units/U1/bearings/UJB/latest"
        while not (await answer(latest))["readings"]["order1_k_eff_xx_n_per_m"]["uncertainty"]:
            await asyncio.sleep(LOOK_EVERY_S)


async def output_of(*command: str, folder: Path) -> str:
    process = await asyncio.create_subprocess_exec(
        *command,
        cwd=folder,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
    )
    said, errors = await process.communicate()
    assert process.returncode == 0, f"{said.decode()[-2000:]}\n{errors.decode()}"
    return said.decode()


@pytest.mark.long
async def test_every_line_on_the_page_about_the_api_works(address, tmp_path):
    lines = "\n".join(fences("sh")).replace(ADDRESS, address)
    before, wrong, after = re.split(r"(curl -s \$API/units/U9.*\n)", lines)
    assert lines.count("curl ") > 20

    said = await output_of("bash", "-euc", f"{REFUSALS}\n{before}{after}", folder=tmp_path)

    assert said.endswith(("304\n", "200\n"))  # nothing was new, or something just then
    assert json.loads((tmp_path / "alarms.json").read_text())["alarms"]

    assert json.loads((tmp_path / "openapi.json").read_text())["info"]["title"] == "padwatch"
    assert json.loads((tmp_path / "evidence.json").read_text())["alarm"]["occurrence"] == 1
    assert "<html" in (tmp_path / "report.html").read_text()
    assert "µm" in (tmp_path / "trend.csv").read_text(encoding="utf-8").splitlines()[0]
    async with httpx2.AsyncClient(base_url=address, trust_env=False, timeout=PATIENCE_S) as client:
        assert (await client.get(ALARM)).json()["is_acknowledged"]
        events = (await client.get("/api/v1/alarms/events")).json()["events"]
        assert "cooler is being cleaned" in json.dumps(events)

    ask = f"API={address}/api/v1; command curl --noproxy '*' {wrong.removeprefix('curl ')}"
    problem = json.loads(await output_of("bash", "-euc", ask, folder=tmp_path))
    assert problem == json.loads(fences("json")[0])

    [client_example] = fences("python")
    (tmp_path / "films.py").write_text(client_example, encoding="utf-8")
    films = await output_of(sys.executable, "films.py", f"{address}/api/v1", folder=tmp_path)
    assert re.search(r"^U1 UJB xx: \d\.\d\d GN/m, ", films, re.MULTILINE), films
