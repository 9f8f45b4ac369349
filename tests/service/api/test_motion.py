"""The motion of a shaft: known ellipses, live and recorded, and what is not there is said."""

import math
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rigs.blocks import cell_block

from core.quality import Reason, bad, missing
from core.samples.blocks import SampleBlock
from core.samples.gaps import SampleAccount
from service.app.recordings import recording_writer
from service.settings.core_values import calibration_of
from service.settings.plant import PlantFile

MOTION = "/api/v1/units/U1/bearings/UJB/motion"
RATE_HZ, TURN_HZ, N = 600.0, 92.3 / 60.0, 50
START_NS = 1_767_225_600_000_000_000
MAJOR, MINOR, ANGLE_DEG = 80.0, 30.0, 25.0
CENTRE_UM = (-12.0, 35.0)
VORTEX_UM = 40.0
STEP_UM = 0.1
"""More than a count of the converter."""
Make = Callable[..., list[SampleBlock]]


def motion_um(seconds: Any) -> tuple[Any, Any]:
    """A forward ellipse at running speed and a vortex, around the centre."""
    turn, angle = 2.0 * math.pi * TURN_HZ * seconds, math.radians(ANGLE_DEG)
    along, across = MAJOR * np.cos(turn), MINOR * np.sin(turn)
    vortex = VORTEX_UM * np.exp(0.25j * turn)
    x = along * math.cos(angle) - across * math.sin(angle) + vortex.real
    y = along * math.sin(angle) + across * math.cos(angle) + vortex.imag
    return x, y


@pytest.fixture
def blocks_of(plant: PlantFile) -> Make:
    """Blocks of U1 from some second on, as its DAQ gives them; gaps shrink as the shaft comes."""
    unit = plant.unit[0]
    calibration = calibration_of(unit)
    rows = [n for n, channel in enumerate(unit.channel) if channel.id.startswith("ujb_shaft_")]
    um_per_count = np.array([[calibration.channels[row].unit_per_count] for row in rows])
    reference = np.array([unit.bearing[0].gap_reference_um]).T
    speed = [92.3 if channel.id == "speed" else math.nan for channel in unit.slow_channel]

    def make(seconds: float, from_s: float = 0.0, epoch: int = 1) -> list[SampleBlock]:
        first = round(from_s * RATE_HZ)
        index = first + np.arange(round(seconds * RATE_HZ))
        moved = np.array(motion_um(index / RATE_HZ)) + np.array([CENTRE_UM]).T
        counts = np.zeros((len(unit.channel), index.size), dtype=np.int16)
        counts[rows] = np.round((reference - moved) / um_per_count)
        return [
            cell_block(
                epoch=epoch,
                first_index=first + at,
                start_ns=START_NS + round((first + at) / RATE_HZ * 1e9),
                rate_hz=RATE_HZ,
                counts=counts[:, at : at + N],
                ok=(True,) * len(unit.channel),
                slow=tuple(speed),
                calibration=calibration,
            )
            for at in range(0, index.size, N)
        ]

    return make


@pytest.fixture
def receive(running: Any) -> Callable[[list[SampleBlock]], None]:
    def take(blocks: list[SampleBlock]) -> None:
        for block in blocks:
            running.live.set_received(block, SampleAccount())

    return take


@pytest.fixture
def keep(capture: Callable[..., Path], plant: PlantFile) -> Callable[[list[SampleBlock]], str]:
    """Puts a recording of blocks where captures are; gives its name."""
    writer = partial(recording_writer, plant.unit[0])
    return lambda blocks: capture("U1", blocks, writer).name


def require_ellipse(body: dict[str, Any]) -> None:
    ellipse = body["order1"]["ellipse"]
    assert ellipse["major_um_pk"] == pytest.approx(MAJOR, rel=0.01)
    assert ellipse["minor_um_pk"] == pytest.approx(MINOR, rel=0.02)
    assert ellipse["angle_deg"] == pytest.approx(ANGLE_DEG, abs=1.0)
    assert ellipse["sense"] == "x_to_y"
    assert body["order1"]["frequency_hz"] == pytest.approx(TURN_HZ)


async def test_the_newest_motion_is_ellipse_and_vortex_since_restart(running, receive, blocks_of):
    receive(blocks_of(12.0))

    body = await running.json(MOTION, seconds=10.0)

    first, n = body["first_index"], body["n_samples"]
    assert (first, n, body["rate_hz"], body["epoch"]) == (1200, 6000, RATE_HZ, 1)
    assert body["start"] == "2026-01-01T00:00:02.000Z"
    x, y = motion_um((first + np.arange(n)) / RATE_HZ)
    assert np.ptp(np.array(body["shaft_x_um"]) - x) < STEP_UM
    assert np.ptp(np.array(body["shaft_y_um"]) - y) < STEP_UM
    require_ellipse(body)
    middle = slice(n // 2 - 400, n // 2 + 400)  # a turn and beyond, far from the ends
    alone = np.hypot(*(np.array(body["order1"][f"shaft_{axis}_um"][middle]) for axis in "xy"))
    assert alone.max() == pytest.approx(MAJOR, rel=0.02)
    assert alone.min() == pytest.approx(MINOR, rel=0.05)
    assert body["centre_um"] == pytest.approx(
        [CENTRE_UM[0] + x.mean(), CENTRE_UM[1] + y.mean()], abs=STEP_UM
    )
    assert (body["clearance_um"], body["speed_rpm"]) == (200.0, pytest.approx(92.3))
    assert {body[name] for name in ("mark", "recording", "offset_s")} == {None}
    assert body["received"] == "2026-01-01T00:00:00.000Z"

    receive(blocks_of(2.0, 100.0, epoch=2))
    body = await running.json(MOTION, seconds=10.0)
    assert (body["epoch"], body["first_index"], body["n_samples"]) == (2, 60_000, 1200)


async def test_missing_samples_and_a_lost_probe_are_null_never_zero(running, receive, blocks_of):
    blocks = blocks_of(6.0)
    lost = list(blocks[20].channel_quality)
    lost[0] = bad(Reason.SENSOR_FAILURE)
    object.__setattr__(blocks[20], "channel_quality", tuple(lost))
    receive([*blocks[:10], *blocks[12:]])

    body = await running.json(MOTION, seconds=6.0)

    x, y = body["shaft_x_um"], body["shaft_y_um"]
    assert [at for at, value in enumerate(y) if value is None] == list(range(500, 600))
    gone = [*range(500, 600), *range(1000, 1050)]
    assert [at for at, value in enumerate(x) if value is None] == gone
    assert None not in body["order1"]["shaft_x_um"][900:2700]


async def test_without_a_speed_there_is_no_motion_at_running_speed(running, receive, blocks_of):
    blocks = blocks_of(5.0)
    for block in blocks:
        object.__setattr__(block, "slow", {**block.slow, "speed": missing(Reason.NOT_MEASURED)})
    receive(blocks)

    body = await running.json(MOTION)

    assert (body["speed_rpm"], body["order1"]) == (None, None)
    assert None not in body["shaft_x_um"]


async def test_a_recording_plays_the_same_motion_at_any_moment(running, keep, blocks_of):
    name = keep(blocks_of(30.0))
    path = f"/api/v1/recordings/{name}/motion"

    body = await running.json(path, bearing="UJB", start_s=11.03, seconds=12.0)

    assert body["first_index"] == round(11.03 * RATE_HZ)
    assert (body["n_samples"], body["offset_s"]) == (7200, pytest.approx(11.03))
    assert (body["recording"], body["total_s"]) == (name, pytest.approx(30.0))
    x, _ = motion_um((body["first_index"] + np.arange(7200)) / RATE_HZ)
    assert np.ptp(np.array(body["shaft_x_um"]) - x) < STEP_UM
    require_ellipse(body)
    spans = []
    for at_s in (20.0, 23.7, 27.4):
        part = await running.json(path, bearing="UJB", start_s=at_s, seconds=3.7)
        spans.append((part["first_index"], part["n_samples"]))
    assert spans == [(12_000, 2220), (14_220, 2220), (16_440, 1560)]  # none lost or repeated


async def test_a_hole_in_a_recording_is_null_and_after_its_end_is_nothing(running, keep, blocks_of):
    path = f"/api/v1/recordings/{keep([*blocks_of(2.0), *blocks_of(2.0, 5.0)])}/motion"

    body = await running.json(path, bearing="UJB", start_s=1.0, seconds=5.0)
    inside = await running.problem(path, 409, bearing="UJB", start_s=3.0, seconds=1.0)
    behind = await running.problem(path, 409, bearing="UJB", start_s=100.0)

    missing_at = [at for at, value in enumerate(body["shaft_x_um"]) if value is None]
    assert missing_at == list(range(600, 2400))
    assert body["n_samples"] == 3000
    assert body["total_s"] == pytest.approx(7.0)
    for problem in (inside, behind):
        assert "its length is 7 s" in problem["detail"]


async def test_a_damaged_recording_is_not_played(running, keep, blocks_of, tmp_path):
    name = keep(blocks_of(5.0))
    samples = tmp_path / "captures" / name / "samples.parquet"
    content = bytearray(samples.read_bytes())
    content[len(content) // 2] ^= 1
    samples.write_bytes(content)

    problem = await running.problem(f"/api/v1/recordings/{name}/motion", 410, bearing="UJB")

    assert str(tmp_path) not in problem["detail"]


async def test_what_is_asked_wrongly_is_refused(running, keep, blocks_of):
    path = f"/api/v1/recordings/{keep(blocks_of(1.0))}/motion"

    nothing_yet = await running.problem(MOTION, 409)
    assert "no sample of unit 'U1' has arrived yet" in nothing_yet["detail"]
    for seconds in (0.0, -1.0, 10.5, 1e300, "nan"):
        await running.problem(MOTION, 422, seconds=seconds)
    for wrong in (
        {"start_s": -1.0},
        {"start_s": 1e300},
        {"seconds": 1e9},
        {"seconds": 101.0},
        {"seconds": "inf"},
        {"channel": "a"},
    ):
        await running.problem(path, 422, **{"bearing": "UJB", **wrong})
    await running.problem(path, 422)
    await running.problem(path, 404, bearing="XJB")
    await running.problem(path.replace("U1-", "U7-"), 404, bearing="UJB")
    await running.problem(MOTION.replace("UJB", "XJB"), 404)
