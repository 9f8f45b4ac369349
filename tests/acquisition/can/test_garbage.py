"""Frames and lines of random content: nothing breaks, and the account stays right."""

import numpy as np
import pytest
from rigs.tiers import covering

from acquisition.calibration import calibrate
from acquisition.can.assembly import Assembler
from acquisition.can.compiler import compile_plan
from acquisition.can.settings import CanLinkSettings
from acquisition.daq.can_dbc import daq_settings
from acquisition.daq.can_frames import FrameEncoder
from core.ring import Ring

START_NS = 1_767_225_600_000_000_000
LINK = CanLinkSettings(interface="virtual", channel="none")


@pytest.mark.parametrize(("share", "fd"), covering([0.02, 0.3, 1.0], [False, True]))
def test_random_frames_of_a_mad_device_never_break_the_account(
    share, fd, shape_of, counts_calibration, counting_feed
):
    """Some frames have random content, and so random counters, epochs and times."""
    random = np.random.default_rng(20261121)
    shape = shape_of(n_channels=12, fd=fd)
    calibration = counts_calibration(n_channels=12)
    plan = compile_plan(daq_settings(shape, LINK, ("um",) * 12), calibration)
    assembler = Assembler(plan, 12, 2, 600.0, 5.0)
    encoder, feed = FrameEncoder(shape), counting_feed(n_channels=12)
    ring = Ring(12, 6000)
    arrived_ns = START_NS
    for _ in range(150):
        frames = []
        for frame in encoder.frames(feed.advance(50)):
            mad = random.random() < share
            frames.append((frame.frame_id, random.bytes(len(frame.data)) if mad else frame.data))
        arrived_ns += int(random.integers(0, 200_000_000))
        for block in assembler.take(frames, arrived_ns):
            ring.write(calibrate(block, calibration))
        assert len(assembler._counted._pending) <= 65
    assert sum(len(t.starts) for t in assembler._builder.tracks._tracks.values()) < 40_000
