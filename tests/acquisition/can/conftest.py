"""A simulated CAN DAQ and padwatch's source for it, in any shape."""

from collections.abc import Callable

import numpy as np
import pytest
from rigs.blocks import cell_block
from rigs.fake_bus import VIRTUAL, FakeBus

from acquisition.can.assembly import FrameAssembler
from acquisition.can.compiler import compile_plan
from acquisition.can.settings import CanChannel, CanLinkSettings, CanSettings
from acquisition.can.source import CanSource
from acquisition.clock import SystemClock
from acquisition.simulated.devices.can_device import CanDevice
from acquisition.simulated.devices.can_shape import CanShape, DaqSignal, daq_settings
from acquisition.simulated.feed import FeedEndedError
from core.samples.blocks import SampleBlock

NS_PER_S = 1_000_000_000
START_NS = 1_767_225_600 * NS_PER_S


class EventfulFeed:
    """A plant's past: random samples, gaps, restarts, sick channels, slow values that change.

    A request gives fewer samples before a gap or a restart, as a recording does.
    """

    def __init__(
        self, n_channels: int = 4, n_blocks: int = 60, seed: int = 1, floats: bool = False
    ) -> None:
        self._random = np.random.default_rng(seed)
        self._shape = (n_channels, floats)
        self._n_left = n_blocks
        self._epoch, self._index, self._stretch = 5, 0, 333

    def advance(self, n_samples: int) -> SampleBlock:
        if self._n_left == 0:
            raise FeedEndedError
        self._n_left -= 1
        if self._stretch == 0:
            self._go_on_elsewhere()
        n_samples = min(n_samples, self._stretch)
        first, self._index = self._index, self._index + n_samples
        self._stretch -= n_samples
        jitter_us = int(self._random.integers(-3, 4))
        start_us = START_NS // 1000 + round(first * 1e6 / 600.0) + jitter_us + 10**7 * self._epoch
        return cell_block(
            epoch=self._epoch,
            first_index=first,
            start_ns=1000 * start_us,
            rate_hz=600.0,
            counts=self._samples(n_samples),
            ok=tuple(bool(ok) for ok in self._random.random(self._shape[0]) < 0.9),
            slow=(float(np.float32(self._random.normal(45.0))), float("nan")),
        )

    def _go_on_elsewhere(self) -> None:
        self._stretch = int(self._random.integers(1, 700))
        if self._random.random() < 0.25:
            self._epoch, self._index = self._epoch + 1, int(self._random.integers(0, 3))
        else:
            self._index += int(
                self._random.choice([1, 7, 49, 50, 51, 600, 65536, 100_000, 2_000_000])
            )

    def _samples(self, n_samples: int) -> np.ndarray:
        n_channels, floats = self._shape
        counts = self._random.integers(-32768, 32768, (n_channels, n_samples)).astype(np.int16)
        if not floats:
            return counts
        units = counts.astype(np.float32) / np.float32(7.0)
        units[:, self._random.random(n_samples) < 0.001] = np.nan
        units[0, 0] = -0.0
        return units


@pytest.fixture
def eventful_feed() -> Callable[..., EventfulFeed]:
    """Builds feeds with gaps and restarts; keywords as in `EventfulFeed`."""
    return EventfulFeed


@pytest.fixture
def shape_of() -> Callable[..., CanShape]:
    """Builds shapes of a DAQ for a calibration in counts; other keywords as in `CanShape`."""

    def build(n_channels: int = 4, n_slow: int = 2, **others) -> CanShape:
        unit = "um" if others.get("floats") else "V"
        return CanShape(
            channels=tuple(DaqSignal(f"channel{n}", unit) for n in range(n_channels)),
            slow=tuple(DaqSignal(f"slow{n}", "degC") for n in range(n_slow)),
            **others,
        )

    return build


@pytest.fixture
def settings_of(tmp_path) -> Callable[..., CanSettings]:
    """Settings of a DBC's text and the signals of each channel; other settings as keywords."""

    def build(text: str, signals: dict[str, str], channel: str = "none", **others) -> CanSettings:
        (tmp_path / "device.dbc").write_text(text)
        return CanSettings(
            link=CanLinkSettings(interface="virtual", channel=channel),
            dbc=tmp_path / "device.dbc",
            channels=tuple(CanChannel(id_, "um", tuple(s.split())) for id_, s in signals.items()),
            **others,
        )

    return build


@pytest.fixture
def assembler_by(counts_calibration) -> Callable[..., FrameAssembler]:
    """Builds the assembler of settings; the rate and the time of its beginning as arguments."""

    def build(settings: CanSettings, rate_hz: float = 600.0, begun_ns: int = 0) -> FrameAssembler:
        n_channels, n_slow = len(settings.channels), len(settings.slow)
        calibration = counts_calibration(n_channels=n_channels, n_slow=n_slow, rate_hz=rate_hz)
        return FrameAssembler(compile_plan(settings, calibration), begun_ns)

    return build


@pytest.fixture
def source_of(counts_calibration) -> Callable[..., CanSource]:
    """Builds sources that read a DAQ of a shape at an endpoint; other settings as keywords."""

    def build(shape: CanShape, endpoint, clock=None, options=None, **settings) -> CanSource:
        link = CanLinkSettings(**endpoint, fd=shape.fd, options=options or {})
        n_channels, n_slow = len(shape.channels), len(shape.slow)
        calibration = counts_calibration(n_channels=n_channels, n_slow=n_slow)
        units = ("um",) * n_channels
        daq = daq_settings(shape, link, units, **settings)
        return CanSource(daq, calibration, clock or SystemClock())

    return build


@pytest.fixture
def read_up_to() -> Callable:
    """Reads everything a source delivers up to a sample of an epoch."""

    async def read(source: CanSource, epoch: int, stop_index: int) -> list[SampleBlock]:
        blocks = []
        async with source.connect() as stream:
            async for block in stream:
                blocks.append(block)
                if block.epoch == epoch and block.stop_index >= stop_index:
                    return blocks
        raise AssertionError("the stream has ended")

    return read


@pytest.fixture
def fake_bus(monkeypatch) -> FakeBus:
    """The bus that python-can opens, whatever virtual bus is asked for."""
    bus = FakeBus()
    monkeypatch.setattr("can.interfaces.virtual.VirtualBus", lambda *_, **__: bus)
    return bus


@pytest.fixture
def fake_bus_source(shape_of, fake_bus, source_of):  # noqa: ARG001
    """Reads a device that sends when a test wants: that it does not is no pause."""
    settings = {"stale_after_s": 60.0, "when_full": "wait"}
    return source_of(shape_of(), VIRTUAL, **settings)


@pytest.fixture
def shape(shape_of):
    return shape_of()


@pytest.fixture
def device(shape, counting_feed):
    return CanDevice(counting_feed(n_channels=4), shape)
