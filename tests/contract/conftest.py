"""Rigs: each sample source on a counting plant, behind the same few handles.

A new adapter joins the contract suite by adding its rig to `ALL` (and to `WIRED` if it has a link
that can be cut).
"""

import tempfile
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from acquisition.clock import SystemClock
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import ModbusRingServer
from acquisition.modbus.ring_source import ModbusRingSettings, ModbusRingSource
from acquisition.recording.manifest import RecordedChannel, RecordedSlowChannel, RecordedUnit
from acquisition.recording.reader import open_recording
from acquisition.recording.source import RecordingSource
from acquisition.recording.writer import RecordingWriter
from acquisition.simulated.source import SimulatedSource
from acquisition.source import SampleSource
from core.machine import Measurand


class ModbusRig:
    """A block ring on a real socket; the plant runs when told."""

    def __init__(self, feed, calibration, clock) -> None:  # noqa: ARG002 - sockets have their own
        self._device = RingDevice(feed)
        self._server = ModbusRingServer(self._device)
        self._calibration = calibration
        self._plug = AsyncExitStack()
        self.step_samples = self._device.layout.samples_per_slot
        self.source: SampleSource

    async def __aenter__(self) -> "ModbusRig":
        await self.plug_in()
        settings = ModbusRingSettings(
            host="127.0.0.1", port=self._server.port, poll_period_s=0.001, timeout_s=5.0
        )
        self.source = ModbusRingSource(settings, self._calibration, SystemClock())
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.pull()

    async def plug_in(self) -> None:
        await self._plug.enter_async_context(self._server)

    async def pull(self) -> None:
        await self._plug.aclose()

    def run(self, n_samples: int) -> None:
        self._device.produce(n_samples // self.step_samples)


class SimulatedRig:
    """A simulated source in real time, on a clock that is stepped."""

    def __init__(self, feed, calibration, clock) -> None:
        self._clock = clock
        self._rate_hz = calibration.rate_hz
        self.step_samples = 50
        self.source: SampleSource = SimulatedSource(feed, calibration, clock, block_samples=50)

    async def __aenter__(self) -> "SimulatedRig":
        return self

    async def __aexit__(self, *_: object) -> None:
        pass

    def run(self, n_samples: int) -> None:
        self._clock.step(n_samples / self._rate_hz)


class RecordingRig:
    """A recording replayed at its own pace, on a clock that is stepped."""

    def __init__(self, feed, calibration, clock) -> None:
        self._feed, self._calibration, self._clock = feed, calibration, clock
        self._parent = tempfile.TemporaryDirectory()
        self.step_samples = 50
        self.source: SampleSource

    async def __aenter__(self) -> "RecordingRig":
        folder = Path(self._parent.name) / "recording"
        with RecordingWriter(folder, recorded(self._calibration), "contract suite") as writer:
            for _ in range(400):
                writer.write(self._feed.advance(self.step_samples))
        self.source = RecordingSource(open_recording(folder), self._clock, speed=1.0)
        return self

    async def __aexit__(self, *_: object) -> None:
        self._parent.cleanup()

    def run(self, n_samples: int) -> None:
        self._clock.step(n_samples / self._calibration.rate_hz)


def recorded(calibration) -> RecordedUnit:
    """Names for the channels of a calibration."""
    return RecordedUnit(
        unit=calibration.unit,
        rate_hz=calibration.rate_hz,
        channels=tuple(
            RecordedChannel(id=f"channel{n}", measurand=Measurand.GAP_UM, **vars(channel))
            for n, channel in enumerate(calibration.channels)
        ),
        slow_channels=tuple(
            RecordedSlowChannel(unit="degC", **vars(slow)) for slow in calibration.slow
        ),
    )


WIRED = [ModbusRig]
ALL = [*WIRED, SimulatedRig, RecordingRig]


@pytest.fixture(params=ALL, ids=lambda kind: kind.__name__)
async def rig(request, counting_feed, counts_calibration, stepped_clock) -> AsyncIterator:
    async with request.param(counting_feed(), counts_calibration(), stepped_clock) as rig:
        yield rig


@pytest.fixture(params=WIRED, ids=lambda kind: kind.__name__)
async def wired_rig(request, counting_feed, counts_calibration, stepped_clock) -> AsyncIterator:
    async with request.param(counting_feed(), counts_calibration(), stepped_clock) as rig:
        yield rig
