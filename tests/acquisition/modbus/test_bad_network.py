"""A network that delays, slices, joins, repeats, changes, swallows and resets: no false sample."""

import contextlib

import pytest
from rigs.hostile_sources import assert_all_true
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
