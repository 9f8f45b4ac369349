"""A reference that is set beside a running service moves its shaft centre within seconds."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rigs.command_line import padwatch

from .conftest import Start

UJB = "/api/v1/units/U1/bearings/UJB"
SHORT = "[analysis]\nsegment_samples = 4096\noverlap = 0.75\nn_segments = 4\n"
"""A result every 1.7 s."""


def value(latest: Any, name: str) -> float:
    found = latest["readings"][name]["value"]
    return math.nan if found is None else float(found)


async def test_a_reference_set_beside_the_running_service_changes_the_eccentricity(
    start: Start, write_plant: Callable[..., Path], tmp_path: Path
) -> None:
    plant = write_plant(tmp_path, {"U1": 0}, source='kind = "simulated"\n', tables=SHORT)
    service = await start("run", str(plant), "--port", "0")
    await service.wait_for_url()
    latest = await service.until(
        f"{UJB}/latest", lambda body: not math.isnan(value(body, "eccentricity_ratio"))
    )
    clearance_um = (await service.get(UJB))["clearance_um"]
    gaps = value(latest, "gap_x_um"), value(latest, "gap_y_um")

    # the shaft is where its gaps are smaller than the reference: 60 and 80 µm from the centre
    command = ("reference", "set", plant, "--unit", "U1", "--bearing", "UJB")
    given = ("--x-um", str(gaps[0] + 60.0), "--y-um", str(gaps[1] + 80.0))
    assert padwatch(*command, "--author", "A. Name", *given).exit_code == 0
    moved = await service.until(
        f"{UJB}/latest",
        lambda body: abs(value(body, "eccentricity_ratio") - 100.0 / clearance_um) < 0.05,
    )
    bearing = await service.get(UJB)

    assert value(moved, "shaft_centre_x_um") == pytest.approx(60.0, abs=10.0)
    assert value(moved, "shaft_centre_y_um") == pytest.approx(80.0, abs=10.0)
    assert bearing["gap_reference_um"] == [gaps[0] + 60.0, gaps[1] + 80.0]
    assert (bearing["reference"]["source"], bearing["reference"]["author"]) == ("given", "A. Name")

    assert padwatch(*command, "--author", "B. Name", "--measured").exit_code == 0
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
