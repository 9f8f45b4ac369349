"""A network that delays, cuts, joins, repeats, swallows and resets: other sources than the ring."""

import contextlib

import pytest
from rigs.hostile_sources import assert_all_true
from rigs.registers import ChannelFifoTcpRig, FifoTcpRig, PolledTcpRig, VectorTcpRig
from rigs.tcp_proxy import MaliciousProxy

from acquisition.errors import LinkError
from acquisition.modbus.transport import TcpTransport

MISCHIEF = {
    "delay": 0.3,
    "slice": 0.5,
    "coalesce": 0.5,
    "duplicate": 0.1,
    "half_close": 0.05,
    "reset": 0.05,
    "swallow": 0.05,
}
N_BLOCKS = {PolledTcpRig: 8, VectorTcpRig: 300, FifoTcpRig: 80, ChannelFifoTcpRig: 80}
"""A block takes a hundred replies of polled registers, two of a rack, about ten of queues."""


def behind_a_proxy(kind: type, seed: int, mischief: dict[str, float]) -> type:
    class Behind(kind):
        timeout_s = 0.1

        async def plug_in(self) -> None:
            await super().plug_in()
            self.proxy = MaliciousProxy(self._server.port, seed, **mischief)
            await self._plug.enter_async_context(self.proxy)

        def _transport(self) -> TcpTransport:
            return TcpTransport(host="127.0.0.1", port=self.proxy.port)

    return Behind


async def read_through(rig, n_blocks: int) -> list:
    """Connect as often as it takes."""
    blocks: list = []
    while len(blocks) < n_blocks:
        with contextlib.suppress(LinkError):
            async with rig.source.connect() as stream:
                rig.run(rig.step_samples)
                async for block in stream:
                    blocks.append(block)
                    if len(blocks) >= n_blocks:
                        break
                    rig.run(rig.step_samples)
    return blocks


ONE_AT_A_TIME = [{kind: share} for kind, share in MISCHIEF.items()]
ALL_TOGETHER = {kind: share / 3.0 for kind, share in MISCHIEF.items()}


@pytest.mark.parametrize("mischief", [*ONE_AT_A_TIME, ALL_TOGETHER], ids="+".join)
@pytest.mark.parametrize("kind", N_BLOCKS)
async def test_no_mischief_of_the_network_makes_a_false_sample_or_hides_a_loss(
    kind, mischief, counting_feed, counts_calibration, stepped_clock
):
    rig_kind = behind_a_proxy(kind, seed=3, mischief=mischief)
    async with rig_kind(counting_feed(), counts_calibration(), stepped_clock) as rig:
        blocks = await read_through(rig, N_BLOCKS[kind])
        n_done = rig.proxy.n_done

    assert_all_true(blocks)
    assert sum(n_done.values()) > 3 * len(mischief)
