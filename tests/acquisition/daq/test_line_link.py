"""A simulated serial line lies under a name of its own, and takes nobody else's."""

import os
from pathlib import Path

import pytest
from rigs.can import shape_of

from acquisition.daq.can_device import CanDevice
from acquisition.daq.can_slcan import SlcanPtyServer
from acquisition.daq.ring_device import RingDevice
from acquisition.daq.ring_server import RtuRingServer
from acquisition.errors import ConfigError, LinkError


@pytest.fixture(params=["modbus", "can"])
def serve(request, counting_feed, counts_calibration):
    def served(link: Path):
        if request.param == "modbus":
            return RtuRingServer(RingDevice(counting_feed()), link=link)
        shape = shape_of(counts_calibration(), fd=False)
        return SlcanPtyServer(CanDevice(counting_feed(), shape), link=link)

    return served


async def test_what_a_killed_daq_left_behind_is_replaced_and_cleared(serve, tmp_path):
    line = tmp_path / "line"
    line.symlink_to("/dev/pts/99999")
    async with serve(line):
        assert line.is_char_device()
    assert not line.is_symlink()


@pytest.mark.parametrize("what", ["a port", "a port by its id", "a file"])
async def test_the_port_of_a_real_device_is_never_taken_away(serve, tmp_path, what):
    line = tmp_path / "line"
    if what == "a port by its id":
        line.symlink_to("/dev/ttyUSB0")
    elif what == "a file":
        line.write_text("kept")
    else:
        os.mkfifo(line)
    before = line.lstat()
    with pytest.raises(ConfigError, match=f"{line}: something else is there; .* a free name"):
        await serve(line).__aenter__()
    after = line.lstat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)


async def test_a_link_that_cannot_be_made_is_a_lost_link(serve, tmp_path):
    with pytest.raises(LinkError, match="nowhere/line: cannot be made: No such file"):
        await serve(tmp_path / "nowhere" / "line").__aenter__()
