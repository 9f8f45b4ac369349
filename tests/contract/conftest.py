"""The rigs of all sources; a new adapter joins the contract suite here.

A rig goes into `ALL`, and into `WIRED` if it has a link that can be cut; such a rig says in
`absence` what its source has to say of a device that is not there, and has `keeps` = False if the
device keeps nothing while nobody is connected. Its module lies in `rigs`.
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


@pytest.fixture(params=WIRED, ids=lambda kind: kind.__name__)
async def wired_rig(request, counting_feed, counts_calibration, stepped_clock) -> AsyncIterator:
    async with request.param(counting_feed(), counts_calibration(), stepped_clock) as rig:
        yield rig
