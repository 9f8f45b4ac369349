"""A network that spoils traffic and a DAQ that lies: no false sample."""

import asyncio
import contextlib
from contextlib import AsyncExitStack

import pytest
from rigs.hostile_sources import COMMON, CONTENTS, KINDS, Trial, assert_all_true, lies_to
from rigs.modbus import ModbusRig
from rigs.registers import ChannelFifoTcpRig, FifoTcpRig, PolledTcpRig, VectorTcpRig
from rigs.tcp_proxy import MaliciousProxy
from rigs.tiers import covering

from acquisition.errors import ConfigError, LinkError
from acquisition.modbus.transport import TcpTransport

HARMLESS = {"delay": 0.3, "slice": 0.5, "coalesce": 0.5}
HARMFUL = {"duplicate": 0.1, "half_close": 0.05, "reset": 0.05, "swallow": 0.05}
MISCHIEF = HARMLESS | HARMFUL
CHANGED = {"corrupt": 0.2, "corrupt_request": 0.15}
"""Only a ring carries checksums that tell."""

N_BLOCKS = {PolledTcpRig: 40, VectorTcpRig: 200, FifoTcpRig: 80, ChannelFifoTcpRig: 80}
"""A block takes ten replies of polled registers, two of a rack, four or more of queues."""

ONE_AT_A_TIME = [{kind: share} for kind, share in MISCHIEF.items()]
ALL_TOGETHER = {kind: share / 3.0 for kind, share in MISCHIEF.items()}


def mischief(*given: dict[str, float]) -> list:
    return [pytest.param(shares, id="+".join(shares)) for shares in given]


async def read_through_a_proxy(build, kind: type, mischief: dict[str, float], n_blocks: int):
    """Connect as often as it takes; return the rig as it was left, and the blocks."""

    class Behind(kind):
        timeout_s = 0.1 if set(mischief) - set(HARMLESS) else 60.0

        async def plug_in(self) -> None:
            await super().plug_in()
            self.proxy = MaliciousProxy(self._server.port, 3, **mischief)
            await self._plug.enter_async_context(self.proxy)

        def _transport(self) -> TcpTransport:
            return TcpTransport(host="127.0.0.1", port=self.proxy.port)

    blocks: list = []
    async with build(Behind) as rig:
        while len(blocks) < n_blocks or blocks[-1].stop_index < rig.n_kept:
            with contextlib.suppress(LinkError, ConfigError):
                async with rig.source.connect() as stream:
                    rig.run(rig.step_samples)
                    async for block in stream:
                        blocks.append(block)
                        if block.stop_index >= rig.n_kept:
                            if len(blocks) >= n_blocks:
                                break
                            rig.run(rig.step_samples)
    return rig, blocks


@pytest.fixture
def build(counting_feed, counts_calibration, stepped_clock):
    return lambda kind: kind(counting_feed(), counts_calibration(), stepped_clock)


@pytest.mark.parametrize(
    ("kind", "mischief"), covering(list(N_BLOCKS), mischief(*ONE_AT_A_TIME, ALL_TOGETHER))
)
async def test_no_mischief_of_the_network_makes_a_false_sample_or_hides_a_loss(
    kind, mischief, build
):
    rig, blocks = await read_through_a_proxy(build, kind, mischief, N_BLOCKS[kind])
    assert_all_true(blocks)
    assert sum(rig.proxy.n_done.values()) >= len(mischief)


@pytest.mark.parametrize(
    "mischief",
    mischief(*ONE_AT_A_TIME, CHANGED, {kind: s / 3.0 for kind, s in (MISCHIEF | CHANGED).items()}),
)
async def test_no_mischief_of_the_network_costs_a_ring_an_uncounted_sample(mischief, build):
    rig, blocks = await read_through_a_proxy(build, ModbusRig, mischief, 100)
    # a slot that was changed on the way at each of four readings is rejected
    assert_all_true(blocks, loses_nothing=True, may_reject="corrupt" in mischief)
    assert blocks[-1].stop_index == rig.n_kept
    assert sum(rig.proxy.n_done.values()) >= len(mischief)


FEW = 4
MANY = {"tcp": 100, "rtu": 20}
N_AT_ONCE = {"tcp": 20, "rtu": 5}
"""On a busy machine, replies of many lines at once would all come after the time-out."""

OF_RIGHT_FORM = [
    COMMON["fewer registers"],  # a queue may be that short
    *(make for lies in CONTENTS.values() for make in lies.values()),
]
"""Read again where a checksum of the content tells; all others cost the connection."""


def cases() -> list:
    """Each wrong reply to one source on each wire is fast; all contents to all sources are long."""
    fast, long = [], []
    for wire in ("tcp", "rtu"):
        sources = [source for link, source in KINDS if link == wire]
        lies = {name: make for source in sources for name, make in lies_to(wire, source).items()}
        for n, (name, make) in enumerate(lies.items()):
            lied_to = [source for source in sources if name in lies_to(wire, source)]
            for source in lied_to:
                case, id_ = (KINDS[wire, source], make), f"{source} over {wire}: {name}"
                long.append(pytest.param(*case, MANY[wire], marks=pytest.mark.long, id=id_))
                if source == lied_to[n % len(lied_to)]:
                    fast.append(pytest.param(*case, FEW, id=f"{id_}, a few"))
    return fast + long


@pytest.mark.parametrize(("kind", "make", "n_contents"), cases())
async def test_no_wrong_reply_becomes_a_sample(
    kind, make, n_contents, counting_feed, counts_calibration, clock_of_its_own
):
    n_trials = min(n_contents, N_AT_ONCE[kind.link])
    async with AsyncExitStack() as plant:
        trials = []
        for seed in range(n_trials):
            rig = kind(counting_feed(), counts_calibration(), clock_of_its_own())
            trials.append(Trial(await plant.enter_async_context(rig), seed))
        await asyncio.gather(*(trial.lie(make, n_contents // n_trials) for trial in trials))
    assert sum(trial.n_told for trial in trials) >= n_contents
    assert make in OF_RIGHT_FORM or any(trial.n_refused for trial in trials)
    for trial in trials:
        trial.assert_nothing_false()
