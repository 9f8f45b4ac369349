"""The rigs of all sources; a new adapter joins the contract suite here.

A rig goes into `ALL`, and into `WIRED` if it has a link that can be cut; such a rig says in
`absence` what its source has to say of a device that is not there, and has `keeps` = False if the
device keeps nothing while nobody is connected: what is not asked for in time is then lost. Its
module lies in `rigs`.
"""

from collections.abc import AsyncIterator

import pytest
from rigs.can import CanFdRig, CanRig
from rigs.modbus import ModbusRig, ModbusRtuRig
from rigs.recording import RecordingRig, UnitsRecordingRig
from rigs.registers import (
    ChannelFifoTcpRig,
    FifoRtuRig,
    FifoTcpRig,
    PolledRtuRig,
    PolledTcpRig,
    VectorRtuRig,
    VectorTcpRig,
)
from rigs.simulated import SimulatedRig

WIRED = [
    CanRig,
    CanFdRig,
    ModbusRig,
    ModbusRtuRig,
    PolledTcpRig,
    PolledRtuRig,
    VectorTcpRig,
    VectorRtuRig,
    FifoTcpRig,
    FifoRtuRig,
    ChannelFifoTcpRig,
]
ALL = [*WIRED, SimulatedRig, RecordingRig, UnitsRecordingRig]


@pytest.fixture(params=ALL, ids=lambda kind: kind.__name__)
async def rig(request, counting_feed, counts_calibration, stepped_clock) -> AsyncIterator:
    async with request.param(counting_feed(), counts_calibration(), stepped_clock) as rig:
        yield rig


LOSSES = {1000: 50, 2000: 350, 3000: 1000}
"""Samples that the converter of a lossy rig never delivers: the first of them, and how many."""


def lossy(feed):
    """A feed that leaves out what is lost."""
    advance = feed.advance

    def leaving_out(n_samples: int):
        feed.n_samples += LOSSES.get(feed.n_samples, 0)
        return advance(n_samples)

    feed.advance = leaving_out
    return feed


@pytest.fixture(
    params=[kind for kind in ALL if getattr(kind, "keeps", True)], ids=lambda kind: kind.__name__
)
async def lossy_rig(request, counting_feed, counts_calibration, stepped_clock) -> AsyncIterator:
    feed = lossy(counting_feed())
    async with request.param(feed, counts_calibration(), stepped_clock) as rig:
        rig.losses = LOSSES
        yield rig


@pytest.fixture(
    params=[kind for kind in ALL if not getattr(kind, "keeps", True)],
    ids=lambda kind: kind.__name__,
)
async def polled_rig(request, counting_feed, counts_calibration, stepped_clock) -> AsyncIterator:
    async with request.param(counting_feed(), counts_calibration(), stepped_clock) as rig:
        rig.losses = LOSSES
        yield rig


@pytest.fixture(params=WIRED, ids=lambda kind: kind.__name__)
async def wired_rig(request, counting_feed, counts_calibration, stepped_clock) -> AsyncIterator:
    async with request.param(counting_feed(), counts_calibration(), stepped_clock) as rig:
        yield rig
