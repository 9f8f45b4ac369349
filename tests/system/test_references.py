"""A reference that is set beside a running service moves its shaft centre within seconds."""

import asyncio
import math
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

Start = Callable[..., Awaitable[Any]]

UJB = "/api/v1/units/U1/bearings/UJB"
SHORT = "[analysis]\nsegment_samples = 4096\noverlap = 0.75\nn_segments = 4\n\n[service]"


@pytest.fixture
def plant_path(demo_file: Path, tmp_path: Path) -> Path:
    """The demonstration plant, simulated in the service's process, a result every 1.7 s."""
    wire = 'kind = "modbus_ring"\nhost = "127.0.0.1"\nport = 0'
    text = demo_file.read_text(encoding="utf-8")
    assert wire in text
    path = tmp_path / "plant.toml"
    path.write_text(
        text.replace(wire, 'kind = "simulated"').replace("[service]", SHORT), encoding="utf-8"
    )
    return path


async def padwatch(*arguments: str, cwd: Path) -> str:
    process = await asyncio.create_subprocess_exec(
        sys.executable,
        *("-m", "service.cli.main", *arguments),
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        cwd=cwd,
        env={"PYTHONPATH": str(Path(__file__).parents[2]), "PATH": ""},
    )
    said, errors = await process.communicate()
    assert process.returncode == 0, errors.decode()
    return said.decode()


def value(latest: Any, name: str) -> float:
    found = latest["readings"][name]["value"]
    return math.nan if found is None else float(found)


@pytest.mark.long
async def test_a_reference_set_beside_the_running_service_changes_the_eccentricity(
    start: Start, plant_path: Path, tmp_path: Path
) -> None:
    service = await start("run", str(plant_path), "--port", "0")
    await service.wait_for_url()
    latest = await service.until(
        f"{UJB}/latest", lambda body: not math.isnan(value(body, "eccentricity_ratio"))
    )
    clearance_um = (await service.get(UJB))["clearance_um"]
    gaps = value(latest, "gap_x_um"), value(latest, "gap_y_um")

    # the shaft is where its gaps are smaller than the reference: 60 and 80 µm from the centre
    command = ("reference", "set", str(plant_path), "--unit", "U1", "--bearing", "UJB")
    given = ("--x-um", str(gaps[0] + 60.0), "--y-um", str(gaps[1] + 80.0))
    await padwatch(*command, "--author", "A. Name", *given, cwd=tmp_path)
    moved = await service.until(
        f"{UJB}/latest",
        lambda body: abs(value(body, "eccentricity_ratio") - 100.0 / clearance_um) < 0.05,
    )
    bearing = await service.get(UJB)

    assert value(moved, "shaft_centre_x_um") == pytest.approx(60.0, abs=10.0)
    assert value(moved, "shaft_centre_y_um") == pytest.approx(80.0, abs=10.0)
    assert bearing["gap_reference_um"] == [gaps[0] + 60.0, gaps[1] + 80.0]
    assert (bearing["reference"]["source"], bearing["reference"]["author"]) == ("given", "A. Name")

    await padwatch(*command, "--author", "B. Name", "--measured", cwd=tmp_path)
    centred = await service.until(
        f"{UJB}/latest", lambda body: value(body, "eccentricity_ratio") < 0.05
    )
    history = await service.get(f"{UJB}/references")

    assert (
        math.hypot(value(centred, "shaft_centre_x_um"), value(centred, "shaft_centre_y_um"))
        < 0.05 * clearance_um
    )
    assert [(r["author"], r["source"]) for r in history] == [
        ("B. Name", "measured"),
        ("A. Name", "given"),
    ]
    assert (await service.get(UJB))["reference"]["set"] == history[0]["set"]
    assert await service.end() == 0

    again = await start("run", str(plant_path), "--port", "0")
    await again.wait_for_url()
    assert (await again.get(UJB))["reference"]["set"] == history[0]["set"]
