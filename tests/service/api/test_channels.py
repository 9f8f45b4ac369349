"""What the API says of channels: their settings, their state and their newest samples."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from rigs.blocks import given_block, with_quality

from core.quality import GOOD, Reading, Reason, bad, missing
from core.samples.blocks import SampleBlock
from core.samples.gaps import SampleAccount
from service.live.status import HELD_S, LinkState
from service.settings.plant import PlantFile

CHANNELS = "/api/v1/units/U1/channels"
WAVEFORM = "/api/v1/units/U1/waveform"
N = 60
START_NS = 1_767_225_600_000_000_000
MakeBlock = Callable[..., SampleBlock]


@pytest.fixture
def make_block(plant: PlantFile) -> MakeBlock:
    """Builds blocks whose sample is its index, channel c a thousand times c more."""
    n_channels = len(plant.unit[0].channel)

    def make(first: int, n: int = N, epoch: int = 1, **slow: Reading) -> SampleBlock:
        index = np.arange(first, first + n, dtype=np.float32)
        offset = 1000.0 * np.arange(n_channels, dtype=np.float32)[:, np.newaxis]
        return given_block(
            unit="U1",
            epoch=epoch,
            first_index=first,
            start_ns=START_NS + first * 1_000_000_000 // 600,
            rate_hz=600.0,
            samples=index + offset,
            channel_quality=(GOOD,) * n_channels,
            slow=slow,
        )

    return make


@pytest.fixture
def receive(running: Any) -> Callable[[SampleBlock], None]:
    return lambda block: running.live.set_received(block, SampleAccount())


def with_bad(block: SampleBlock, row: int) -> SampleBlock:
    quality = list(block.channel_quality)
    quality[row] = bad(Reason.SENSOR_FAILURE)
    return with_quality(block, tuple(quality))


async def test_every_channel_is_listed_with_its_settings_in_wire_order(read_only, plant):
    body = await read_only.json(CHANNELS)

    unit = plant.unit[0]
    assert [each["settings"]["id"] for each in body["waveform"]] == [
        channel.id for channel in unit.channel
    ]
    ids = [each["settings"]["id"] for each in body["slow"]]
    assert ids == [channel.id for channel in unit.slow_channel]
    first, settings = body["waveform"][0], unit.channel[0]
    assert first["used_by"] == ["UJB shaft_x"]
    assert (first["unit"], first["direction"]) == ("um", -1)
    assert first["settings"] == settings.model_dump(mode="json")
    oil = body["slow"][ids.index(unit.bearing[0].oil_temperature)]
    assert oil["used_by"] == ["UJB oil_temperature"]


async def test_a_channel_shows_the_samples_of_its_newest_block(running, make_block, receive, plant):
    speed = plant.unit[0].speed_channel
    assert speed is not None
    receive(make_block(0))
    receive(with_bad(make_block(N, **{speed: Reading(90.9)}), 1))
    running.clock.step(2_000_000_000)

    body = await running.json(CHANNELS)

    good, lost = body["waveform"][:2]
    assert (good["minimum"], good["maximum"], good["mean"]) == (60.0, 119.0, 89.5)
    assert (lost["minimum"], lost["maximum"], lost["mean"]) == (None, None, None)
    assert lost["quality"] == {"level": "bad", "reason": "sensor_failure"}
    readings = {each["settings"]["id"]: each for each in body["slow"]}
    assert readings[speed]["value"] == 90.9
    assert body["received"] == "2026-01-01T00:00:00.000Z"
    others = {each["quality"]["reason"] for id_, each in readings.items() if id_ != speed}
    assert others == {"not_measured"}


async def test_channels_of_a_lost_link_show_no_number(running, make_block, receive):
    waiting = await running.json(CHANNELS)
    receive(make_block(0, slow=missing(Reason.OUT_OF_RANGE)))
    running.live.set_link("U1", LinkState.NOT_CONNECTED, "timed out")
    lost = await running.json(CHANNELS)

    for body, reason in ((waiting, "waiting_for_data"), (lost, "not_connected")):
        everything = [*body["waveform"], *body["slow"]]
        assert {each["quality"]["reason"] for each in everything} == {reason}
        assert {each["mean"] for each in body["waveform"]} == {None}
        assert {each["value"] for each in body["slow"]} == {None}


async def test_the_waveform_is_newest_samples_across_blocks(running, make_block, receive, plant):
    for first in range(0, 200 * N, N):
        receive(make_block(first))
    assert sum(block.n_samples for block in running.live.blocks("U1")) <= (HELD_S + 2) * 600
    wanted = [plant.unit[0].channel[n].id for n in (2, 0)]

    body = await running.json(WAVEFORM, channel=wanted, seconds=0.25)

    assert list(body["channels"]) == wanted
    assert body["channels"][wanted[1]]["sample"] == list(range(11_850, 12_000))
    assert body["channels"][wanted[0]]["sample"] == list(range(13_850, 14_000))
    assert (body["first_index"], body["n_samples"], body["rate_hz"]) == (11_850, 150, 600.0)
    assert body["time"] == "2026-01-01T00:00:19.750Z"


async def test_missing_and_bad_samples_of_a_waveform_are_null(running, make_block, receive, plant):
    receive(make_block(0))
    receive(with_bad(make_block(2 * N), 0))  # the block between never arrived
    x, y = (plant.unit[0].channel[n].id for n in (0, 1))

    body = await running.json(WAVEFORM, channel=[x, y])

    nothing = [None] * N
    assert body["channels"][x]["sample"] == [*range(N), *nothing, *nothing]
    assert body["channels"][x]["quality"]["level"] == "bad"
    assert body["channels"][y]["sample"][N : 2 * N] == nothing
    assert body["channels"][y]["sample"][2 * N :] == list(range(1120, 1180))
    assert body["channels"][y]["quality"]["level"] == "good"

    receive(make_block(0, epoch=2))  # no waveform spans a restart of the device
    body = await running.json(WAVEFORM)
    assert (body["epoch"], body["first_index"], body["n_samples"]) == (2, 0, N)


async def test_a_waveform_that_there_is_not_is_a_problem(running, make_block, receive, monkeypatch):
    assert "has arrived" in (await running.problem(WAVEFORM, 409))["detail"]
    receive(make_block(0))
    unknown = await running.problem(WAVEFORM, 422, channel="no_such")
    assert unknown["errors"][0]["parameter"] == "channel"
    for seconds in ("0", "10.1", "nan", "inf", "-1"):
        assert await running.problem(WAVEFORM, 422, seconds=seconds)
    monkeypatch.setattr("service.api.routes.channels.MAX_NUMBERS", 100)
    assert "at most" in (await running.problem(WAVEFORM, 422, seconds=1.0))["detail"]
    await running.problem("/api/v1/units/U9/waveform", 404)
    await running.problem("/api/v1/units/U9/channels", 404)


async def test_sources_count_failed_attempts(running):
    for _ in range(2):
        running.live.set_link("U2", LinkState.NOT_CONNECTED, "127.0.0.1:502: Connection refused")

    first, second = await running.json("/api/v1/sources")

    assert (first["unit"], first["state"], first["n_failed"]) == ("U1", "connected", 0)
    assert (second["unit"], second["state"], second["n_failed"]) == ("U2", "not_connected", 3)
    assert second["reason"] == "127.0.0.1:502: Connection refused"
    assert first["kind"] == "modbus_ring"
    assert first["rate_hz"] == 600.0
    assert first["poll_period_s"] > 0.0
