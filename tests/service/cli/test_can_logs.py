"""A log of a CAN DAQ's frames is imported as what the DAQ measured."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import can
import pytest

from acquisition.can.settings import CanLinkSettings, CanSettings
from acquisition.delivery.blocks import BlockJoiner, RawBlock, sample_block
from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ImportJob, TimeAxis
from acquisition.recordings.reading import imported_frames
from acquisition.simulated.devices.can_device import CanDevice
from acquisition.simulated.devices.can_frames import WireFrame
from acquisition.simulated.devices.can_shape import CanShape, DaqSignal, daq_dbc, daq_settings
from acquisition.simulated.feed import FeedEndedError
from core.samples.blocks import SampleBlock
from core.samples.calibration import UnitCalibration
from service.cli.offline.importing import CanLogDecoder

START_S = 1_767_225_600


class GappyFeed:
    """The counting feed with holes, a sick channel and slow values that change."""

    def __init__(self, feed) -> None:
        self._feed, self.sent = feed, []

    def advance(self, n_samples: int) -> RawBlock:
        number = len(self.sent)
        if number == 200:
            raise FeedEndedError
        if number % 30 == 29:
            self._feed.advance(7 * number)
        raw = self._feed.advance(n_samples)
        ok = (True, number % 13 != 0)
        stamp_ns = raw.start_ns // 1000 * 1000
        self.sent.append(replace(raw, ok=ok, slow=(40.0 + number, float("nan")), start_ns=stamp_ns))
        return self.sent[-1]


@pytest.mark.parametrize("kind", ["candump", "blf"])
@pytest.mark.parametrize("fd", [False, True])
def test_every_sample_flag_and_stamp_comes_back(
    counting_feed: Callable[..., object],
    counts_calibration: Callable[..., UnitCalibration],
    tmp_path: Path,
    kind: str,
    fd: bool,
) -> None:
    shape = CanShape(
        channels=(DaqSignal("c0", "V", 1.0), DaqSignal("c1", "V", 1.0)),
        slow=(DaqSignal("slow0", "degC"), DaqSignal("slow1", "degC")),
        fd=fd,
    )
    feed = GappyFeed(counting_feed())
    device = CanDevice(feed, shape)
    write_log(tmp_path / "log", kind, device)
    (tmp_path / "daq.dbc").write_text(daq_dbc(shape), encoding="utf-8")
    link = CanLinkSettings(interface="virtual", channel="none", fd=fd)
    settings: CanSettings = daq_settings(shape, link, ("um", "um"))
    decoder = CanLogDecoder(settings, counts_calibration())
    job = ImportJob(format=kind, rate_hz=600.0, time=TimeAxis("file", 0))
    read = imported_frames(tmp_path / "log", job)
    raws = [raw for frames, _ in read for raw in decoder.take(frames)]
    assert on_grid(raws, counts_calibration()) == on_grid(feed.sent, counts_calibration())


def test_a_log_of_two_devices_under_the_same_ids_is_refused(
    counting_feed: Callable[..., object],
    counts_calibration: Callable[..., UnitCalibration],
    tmp_path: Path,
) -> None:
    shape = CanShape(
        channels=(DaqSignal("c0", "V", 1.0), DaqSignal("c1", "V", 1.0)),
        slow=(DaqSignal("slow0", "degC"), DaqSignal("slow1", "degC")),
    )
    one, other = (CanDevice(GappyFeed(counting_feed()), shape) for _ in range(2))
    for _ in range(20):  # of the same make, and on for a little longer
        other.next_frames()
        other.produce()
    write_log(tmp_path / "log", "candump", one, other)
    link = CanLinkSettings(interface="virtual", channel="none")
    decoder = CanLogDecoder(daq_settings(shape, link, ("um", "um")), counts_calibration())
    job = ImportJob(format="candump", rate_hz=600.0, time=TimeAxis("file", 0))
    every_batch = (decoder.take(frames) for frames, _ in imported_frames(tmp_path / "log", job))
    with pytest.raises(ConfigError, match="do two devices send the same CAN ids"):
        list(every_batch)


def write_log(path: Path, kind: str, *devices: CanDevice) -> None:
    writer = can.CanutilsLogWriter if kind == "candump" else can.BLFWriter
    with writer(path) as log:
        n_frames = 0
        while all(device.has_frames for device in devices):
            for frame in (frame for device in devices for frame in device.next_frames()):
                log(as_message(frame, n_frames))
                n_frames += 1
            for device in devices:
                device.produce()


def as_message(frame: WireFrame, number: int) -> can.Message:
    return can.Message(
        timestamp=START_S + number * 1e-4,
        arbitration_id=frame.frame_id,
        is_extended_id=frame.extended,
        is_fd=frame.fd,
        data=frame.data,
    )


def on_grid(raws: list[RawBlock], calibration: UnitCalibration) -> list[SampleBlock]:
    joiner = BlockJoiner(50)
    blocks = [b for raw in raws for b in joiner.put(sample_block([raw], calibration))]
    return blocks + joiner.flush()
