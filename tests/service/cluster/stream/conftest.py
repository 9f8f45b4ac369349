"""Blocks that use everything a block can hold, and a real server."""

from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from harness.ledger_plant import LedgerPlant
from harness.moving_unit import MovingUnit
from harness.nats_server import NatsServer, nats_server, nats_server_command
from nats import connect
from rigs.blocks import given_block
from rigs.memory_folder import memory_folder, path_in_memory  # noqa: F401 - a fixture

from core.quality import GOOD, Reading, Reason, missing, uncertain
from core.samples.blocks import DeviceClock, Rejection, SampleBlock, StampFault
from service.cluster.frames import UnitIdentity, fingerprint

SHORT = LedgerPlant(n_units=1, load=1.0, segment_samples=1024, n_segments=3)
T0 = 1_767_225_600_123_456_789


@pytest.fixture
def identity() -> UnitIdentity:
    return UnitIdentity("U1", fingerprint("Plant"), fingerprint("sx", "sy"))


@pytest.fixture
def block() -> SampleBlock:
    samples = np.random.default_rng(7).normal(2000.0, 50.0, (2, 60)).astype(np.float32)
    samples[0, 3], samples[1, 4], samples[0, 5] = np.nan, np.inf, -0.0
    return given_block(
        unit="U1",
        epoch=4_000_000_000,
        first_index=2**40 + 1,
        start_ns=T0,
        rate_hz=600.0,
        samples=samples,
        channel_quality=(GOOD, uncertain(Reason.CLIPPED)),
        slow={
            "speed": Reading(90.9, u_random=0.1, u_systematic=0.2, interval_95=(90.0, 91.0)),
            "oil": missing(Reason.SENSOR_FAILURE),
            "odd": Reading(1 / 3, uncertain(Reason.OUT_OF_RANGE)),
        },
        rejected=(Rejection("torn_read", 60),),
        clock=DeviceClock(0.1, -3.5, None, 2),
        stamp_fault=StampFault.JUMPED,
    )


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(3)


@pytest.fixture
def moving_unit(tmp_path: Path) -> Callable[[str], MovingUnit]:
    """Builds units whose analysis is moved, each with a folder of its own."""

    def build(name: str) -> MovingUnit:
        folder = tmp_path / name
        folder.mkdir()
        return MovingUnit(SHORT.write(folder / "plant.toml", folder / "data", {"U1": 9}))

    return build


@pytest.fixture(scope="session")
def nats_of_process() -> Iterator[NatsServer]:
    """The server that all tests of a process share."""
    if nats_server_command() is None:
        pytest.skip("needs nats-server")
    with memory_folder() as folder, nats_server(folder) as running:
        yield running


@pytest.fixture
async def server(nats_of_process: NatsServer) -> AsyncIterator[NatsServer]:
    """A server that keeps nothing of earlier tests; it may be killed and started."""
    yield nats_of_process
    if not nats_of_process.is_running:
        nats_of_process.start()
    client = await connect(nats_of_process.url)
    stream = client.jetstream()
    for info in await stream.streams_info():
        await stream.delete_stream(str(info.config.name))
    await client.close()
