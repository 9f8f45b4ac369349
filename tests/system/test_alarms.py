"""A lost probe becomes an alarm of the running service and stays known."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.clock import SystemClock
from acquisition.recordings.reader import open_recording
from acquisition.simulated.devices.modbus_links import ModbusTcpServer
from acquisition.simulated.devices.ring_device import RingDevice
from acquisition.simulated.feed import SampleFeed
from core.samples.blocks import SampleBlock
from service.measuring.simulated_sources import simulated_feed
from service.settings.plant import load_plant_file

from .conftest import WIRE

PROBE = "U1:ujb_shaft_x:channel_not_ok"
LINK = "U1:link:link_lost"

SETTINGS = """
[alarms]
channel_on_delay_s = 0.5
link_lost_after_s = 5.0

[capture]
pre_s = 1.5
post_s = 2.0
max_s = 10.0
"""


PATIENT = f"{WIRE}timeout_s = 5.0\n"
"""A busy machine may answer late."""


class BreakableFeed:
    """A simulated machine whose first probe fails when told, and a copy of all it has delivered."""

    def __init__(self, feed: SampleFeed) -> None:
        self._feed = feed
        self.is_broken = False
        self.delivered: list[SampleBlock] = []

    def advance(self, n_samples: int) -> SampleBlock:
        raw = self._feed.advance(n_samples)
        if self.is_broken:
            raw.side.ok[0] = False
        self.delivered.append(raw)
        return raw

    def counts(self, first_index: int, n_samples: int) -> Any:
        """What was delivered of these samples."""
        found = np.concatenate([raw.counts for raw in self.delivered], axis=1)
        start = first_index - self.delivered[0].first_index
        return found[:, start : start + n_samples]


@asynccontextmanager
async def plugged_in(feed: SampleFeed) -> AsyncIterator[int]:
    """A DAQ with this machine behind it, at its own pace; the port it listens on."""
    async with ModbusTcpServer(RingDevice(feed), SystemClock()) as server:
        running = asyncio.create_task(server.run())
        try:
            yield server.port
        finally:
            running.cancel()
            with suppress(asyncio.CancelledError):
                await running


def by_id(answer: Any) -> dict[str, Any]:
    return {alarm["id"]: alarm for alarm in answer["alarms"]}


async def test_a_lost_probe_outlives_a_lost_link_and_its_samples_are_kept(
    start, tmp_path, demo_file, write_plant
):
    folder = tmp_path / "data"
    feed = BreakableFeed(simulated_feed(load_plant_file(demo_file).unit[0], SystemClock()))
    async with plugged_in(feed) as port:
        plant = write_plant(tmp_path, {"U1": port}, source=PATIENT, tables=SETTINGS)
        service = await start("run", str(plant), "--port", "0")
        await service.wait_for_url()
        await service.until("/api/v1/units/U1", lambda u: u["source"]["n_stored"] > 1200)
        assert PROBE not in by_id(await service.get("/api/v1/alarms"))

        feed.is_broken = True
        lost = await service.until("/api/v1/alarms", lambda a: PROBE in by_id(a))
        await service.until("/api/v1/recordings", lambda r: r["recordings"])
        overview = await service.get("/api/v1/overview")

    assert by_id(lost)[PROBE]["state"] == "unacknowledged"
    assert by_id(lost)[PROBE]["condition_reason"] == "sensor_failure"
    assert overview["captures_error"] is None
    check_capture(folder / "captures", feed)

    silent = await service.until("/api/v1/alarms", lambda a: LINK in by_id(a))
    probe = by_id(silent)[PROBE]
    assert (probe["state"], probe["is_active"]) == ("unacknowledged", True)
    assert (probe["condition"], probe["condition_reason"]) == ("unknown", "not_connected")
    assert await service.end() == 0
    assert "Traceback" not in service.errors


def check_capture(captures: Path, feed: BreakableFeed) -> None:
    """One recording, bit for bit what the device delivered from before the fault to after it."""
    [path] = captures.iterdir()
    recording = open_recording(path)
    assert f"alarm {PROBE} occurrence 1" in recording.manifest.made_by
    blocks = list(recording.blocks())
    for raw in blocks:
        n_samples = raw.counts.shape[1]
        assert np.array_equal(raw.counts, feed.counts(raw.first_index, n_samples))
    ok = [bool(each) for raw in blocks for each in raw.side.ok[0]]
    n_before, n_after = ok.count(True), ok.count(False)
    assert ok == [True] * n_before + [False] * n_after
    # a cell is a twelfth of a second: 1.5 s before the alarm, of which 0.5 s is its delay; whole
    # blocks are kept, of up to half a second
    assert 10 <= n_before <= 13 + 6
    assert 29 <= n_after <= 33 + 6
