"""The rigs of all sources; a new adapter joins the contract suite here.

A rig goes into `ALL`, and into `WIRED` if it has a link that can be cut; such a rig says in
`absence` what its source has to say of a device that is not there, and has `keeps` = False if the
device keeps nothing while nobody is connected: what is not asked for in time is then lost. Its
module lies in `rigs`.
"""

from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
from rigs.can import CanFdRig, CanRig
from rigs.modbus import InFlightRig, ModbusRig, ModbusRtuRig
from rigs.recording import RecordingRig, SimulatedRig, UnitsRecordingRig
from rigs.registers import REGISTER_RIGS

WIRED = [CanRig, CanFdRig, ModbusRig, InFlightRig, ModbusRtuRig, *REGISTER_RIGS]
ALL = [*WIRED, SimulatedRig, RecordingRig, UnitsRecordingRig]


def rigs_of(kinds: list[type]) -> list:
    """Parameters of a fixture that builds rigs.

    Sources of registers are here over TCP, too: their lines are long, but in `wired_rig`.
    """
    long = [kind for kind in REGISTER_RIGS if kind.__name__.endswith("RtuRig")]
    return [
        pytest.param(kind, id=kind.__name__, marks=pytest.mark.long if kind in long else ())
        for kind in kinds
    ]


@pytest.fixture
def build_rig(counting_feed, counts_calibration, stepped_clock) -> Callable[..., Any]:
    """Build a rig of some kind; all that was converted but is lost is given in `losses`."""

    def build(kind: type, losses: dict[int, int] | None = None) -> Any:
        feed = lossy(counting_feed(), losses or {})
        rig = kind(feed, counts_calibration(), stepped_clock)
        rig.losses = losses
        return rig

    return build


@pytest.fixture(params=rigs_of(ALL))
async def rig(request, build_rig) -> AsyncIterator:
    async with build_rig(request.param) as rig:
        yield rig


LOSSES = {1000: 50, 2000: 350, 3000: 1000}
"""Samples that are lost: the first of them, and how many."""


def lossy(feed, losses: dict[int, int]):
    """A converter that never delivers what is lost."""
    advance = feed.advance

    def leaving_out(n_samples: int):
        feed.n_samples += losses.get(feed.n_samples, 0)
        return advance(n_samples)

    feed.advance = leaving_out
    return feed


@pytest.fixture(params=rigs_of([kind for kind in ALL if getattr(kind, "keeps", True)]))
async def lossy_rig(request, build_rig) -> AsyncIterator:
    async with build_rig(request.param, LOSSES) as rig:
        yield rig


@pytest.fixture(params=rigs_of([kind for kind in ALL if not getattr(kind, "keeps", True)]))
async def polled_rig(request, build_rig) -> AsyncIterator:
    async with build_rig(request.param) as rig:
        rig.losses = LOSSES
        yield rig


@pytest.fixture(params=WIRED, ids=lambda kind: kind.__name__)
async def wired_rig(request, build_rig) -> AsyncIterator:
    async with build_rig(request.param) as rig:
        yield rig
