"""A film that softens in the machine is an alarm at the API, through everything in between.

The plant is that of `padwatch demo`: a simulated DAQ, a process of its own, behind Modbus TCP; a
service that reads it in real time; and a year of readings from which a baseline was learned. A
minute after the start the film of U2's UJB loses 30 % of its stiffness (`deploy/demo-life.toml`).
"""

import asyncio
import json
import re
from pathlib import Path
from typing import Any

import pytest

from .conftest import Program

ROOT = Path(__file__).parents[2]
LOSS = 0.3
SOFTENED = {"U2:UJB:film_stiffness"}
PATIENCE_S = 1200.0
"""The year before the start is simulated within a minute; the alarms come 4 to 5 minutes after it,
as averages are over two and a half. A busy machine takes several times as long."""


def of_films(found: Any) -> set[str]:
    return {alarm["id"] for alarm in found["alarms"] if alarm["kind"] == "film_stiffness"}


def in_danger(found: Any) -> bool:
    return of_films({"alarms": [a for a in found["alarms"] if a["level"] == "danger"]}) >= SOFTENED


def in_both_directions(found: Any) -> bool:
    return [a["directions"] for a in found["alarms"] if a["id"] in SOFTENED] == ["xy"]


def causes_are_known(film: Any) -> bool:
    """Whether c/k has told that it is the oil; before, the shaft's motion may tell of the film."""
    return all((film[d]["cause"] or {}).get("cause") == "oil" for d in ("x", "y"))


async def acknowledge_as_in_the_tutorial(program: Program) -> None:
    """Run the tutorial's shell example against a program with the alarm."""
    text = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    [example] = [sh for sh in re.findall(r"```sh\n(.*?)```", text, re.DOTALL) if "curl" in sh]
    curl = "curl() { command curl --fail-with-body --noproxy '*' \"$@\"; }"
    lines = example.replace("http://127.0.0.1:8080", program.url.rstrip("/"))
    shell = await asyncio.create_subprocess_exec(
        *("bash", "-euc", f"{curl}\n{lines}"), stdout=asyncio.subprocess.PIPE
    )
    answer, _ = await shell.communicate()
    assert shell.returncode == 0, answer
    assert json.loads(answer)["is_acknowledged"]


@pytest.mark.long
@pytest.mark.timeout(3000)
async def test_a_film_that_loses_stiffness_in_the_machine_is_an_alarm_at_the_api_and_no_other_is(
    start, tmp_path
):
    program = await start("demo", "--port", "0", "--data-folder", str(tmp_path / "data"))
    await program.wait_for_url(PATIENCE_S)
    before = await program.get("/api/v1/alarms")

    found = await program.until(
        "/api/v1/alarms", lambda found: of_films(found) >= SOFTENED, PATIENCE_S
    )

    await acknowledge_as_in_the_tutorial(program)
    assert of_films(before) == set()
    assert of_films(found) == SOFTENED
    units = await program.get("/api/v1/units")
    assert [unit["source"]["state"] for unit in units] == ["connected"] * 2
    for alarm in found["alarms"]:
        if alarm["id"] in SOFTENED:
            assert -100.0 * LOSS - 10.0 < alarm["value"] < alarm["limit"] < 0.0
            assert alarm["raised_at"]["operating_state"] == "full_load"
            cell = alarm["raised_at"]["cell"]
            assert cell["eccentricity_low"] <= alarm["raised_at"]["eccentricity_ratio"]
            assert alarm["raised_at"]["oil_temperature_c"] < cell["oil_temperature_high_c"]
    await program.until("/api/v1/alarms", in_danger, PATIENCE_S)  # as the tutorial says
    await program.until("/api/v1/alarms", in_both_directions, PATIENCE_S)
    film = await program.until("/api/v1/units/U2/bearings/UJB/film", causes_are_known, PATIENCE_S)
    for direction in ("x", "y"):
        assert film[direction]["deviation"]["percent"] == pytest.approx(-100.0 * LOSS, abs=6.0)
        assert "c/k did not" in film[direction]["cause"]["reason"]
    chosen = {"kind": "film_stiffness", "unit": "U2", "state": "full_load"}
    *_, first = (await program.get("/api/v1/alarms/events", **chosen))["events"]
    assert (first["alarm"], first["change"]) == ("U2:UJB:film_stiffness", "raised")
    assert (await program.get("/api/v1/alarms/events", **chosen, oil_temperature_max=0.0))[
        "events"
    ] == []
