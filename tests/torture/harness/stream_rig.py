"""Blocks on a real stream, and what a single process makes of the same blocks in the same order."""

import asyncio
import sqlite3
import time
from collections.abc import AsyncIterator, Iterable, Iterator, Sequence
from contextlib import asynccontextmanager, closing
from pathlib import Path

import nats
import numpy as np
from rigs.blocks import given_block

from acquisition.clock import Clock, SystemClock
from core.quality import GOOD, Reading
from core.samples.blocks import SampleBlock
from core.units import NS_PER_S
from harness.ledger_plant import LedgerPlant
from harness.nats_server import NatsServer
from harness.waiting import at_work
from service.app.analysis import Analysis
from service.app.cluster_processes import Analysing
from service.app.storage import open_store
from service.cluster.frames import Taken, decoded
from service.cluster.ownership import Partition
from service.cluster.publisher import Publisher
from service.cluster.session import identity_of, stream_name, subject
from service.live.status import LinkState
from service.measuring.acquirer import LinkNews
from service.measuring.alarm_engine import WHOLE, PlantPart
from service.measuring.live_view import LiveView
from service.measuring.sources import monitor_of
from service.notifications.message import LiveContext
from service.settings.core_values import stale_after_s
from service.settings.plant import PlantFile, load_plant_file
from service.settings.storage import Origin
from service.store.sqlite import SqliteStore
from service.store.store import Store

LEDGER = LedgerPlant(n_units=2, load=1.0, segment_samples=8192, n_segments=2)
T0 = 1_767_225_600 * NS_PER_S
N_SAMPLES = 600
WAIT_S = 60.0


def written_plant(folder: Path, server: NatsServer, name: str = "plant") -> Path:
    """A plant file whose units come from the stream; their devices are not there."""
    stream = f'[stream]\nservers = ["{server.url}"]\nmax_gb = 0.5\nsilent_after_s = 30.0\n'
    ports = dict.fromkeys(LEDGER.units, 9)
    return LEDGER.write(folder / f"{name}.toml", folder / name, ports, stream)


def blocks(plant: PlantFile, unit: str, n_blocks: int, seed: int) -> Iterator[SampleBlock]:
    """A turning shaft with noise, spells beyond the limit, gaps, and a restart of the device."""
    settings = next(its for its in plant.unit if its.id == unit)
    rng = np.random.default_rng([seed, sum(unit.encode())])
    n_channels, rate_hz = len(settings.channel), settings.sampling_hz
    shaft = np.array(["shaft" in channel.id for channel in settings.channel])
    turn_hz = settings.rated_speed_rpm / 60.0
    first, epoch = 0, 7
    for number in range(n_blocks):
        if number % 97 == 60:
            first += 5 * N_SAMPLES
        if number == n_blocks // 2 + 11:
            first, epoch = 0, epoch + 1
        size_um = 160.0 if number % 140 > 95 else 40.0
        t_s = (number * N_SAMPLES + np.arange(N_SAMPLES)) / rate_hz
        phase = np.arange(n_channels) * np.pi / 2
        size = np.where(shaft, size_um, 2.0)[:, np.newaxis]
        turning = size * np.cos(2 * np.pi * turn_hz * t_s - phase[:, np.newaxis])
        noise = rng.normal(0.0, 0.5, (n_channels, N_SAMPLES))
        samples = turning + noise + np.where(shaft, 2000.0, 0.0)[:, np.newaxis]
        yield given_block(
            unit=unit,
            epoch=epoch,
            first_index=first,
            start_ns=T0 + round(float(t_s[0]) * NS_PER_S),
            rate_hz=rate_hz,
            samples=samples.astype(np.float32),
            channel_quality=(GOOD,) * n_channels,
            slow={
                channel.id: Reading(90.0 if channel.id == "speed" else 45.0)
                for channel in settings.slow_channel
            },
        )
        first += N_SAMPLES


async def publish(plant: PlantFile, sent: Iterable[SampleBlock]) -> None:
    """Put blocks on the stream; returns when the servers have confirmed them all."""
    assert plant.stream is not None
    identities = {unit.id: identity_of(plant, unit) for unit in plant.unit}
    publisher = Publisher(plant, plant.stream, identities, SystemClock())
    async with at_work(publisher.run()):
        for block in sent:
            await publisher.publish(block)
        await asyncio.wait_for(publisher.waiting.drained(), WAIT_S)


def analysis_of(plant: PlantFile, clock: Clock, store: Store, part: PlantPart = WHOLE) -> Analysis:
    """The analysis of all units, which has not been started."""
    monitors = {unit.id: monitor_of(unit, plant.analysis) for unit in plant.unit}
    live = LiveView(monitors, clock, stale_after_s(plant))
    context = LiveContext(live.assessment)
    return Analysis(plant, Origin.LIVE, clock, store, live, context, monitors, part)


@asynccontextmanager
async def analysing(plant: PlantFile) -> AsyncIterator[Analysis]:
    """Run the analysis of a process; what is not stored when this is left is lost."""
    store = open_store(plant)
    analysis = analysis_of(plant, SystemClock(), store, Partition().share_of(plant))
    assert plant.stream is not None
    process = Analysing(plant, plant.stream, analysis)
    task = asyncio.create_task(process.run())
    try:
        yield analysis
    finally:
        task.cancel()
        await asyncio.wait([task])
        await process.close()
        store.close()


Sent = tuple[str, SampleBlock | LinkNews]


async def on_the_stream(plant: PlantFile, server: NatsServer) -> list[Sent]:
    """All that the stream holds, in its order."""
    identities = {subject(plant, unit.id): identity_of(plant, unit) for unit in plant.unit}
    client = await nats.connect(server.url)
    try:
        stream = client.jetstream()
        state = (await stream.stream_info(stream_name(plant))).state
        found: list[Sent] = []
        for sequence in range(state.first_seq, state.last_seq + 1):
            message = await stream.get_msg(stream_name(plant), sequence, direct=True)
            identity = identities[str(message.subject)]
            told = decoded(message.data or b"", identity)
            found.append((identity.unit, told.block if isinstance(told, Taken) else told))
        return found
    finally:
        await client.close()


async def single_process(plant_file: Path, sent: Sequence[Sent]) -> Path:
    """Let one process make of it what it makes; returns its database."""
    plant, clock = load_plant_file(plant_file), SystemClock()
    path = Path(plant.service.data_folder) / "padwatch.sqlite3"
    store = SqliteStore(path)
    analysis = analysis_of(plant, clock, store)
    await analysis.start()
    try:
        for unit, message in sent:
            if isinstance(message, LinkNews):
                analysis.analyser.note_link(message)
            else:
                analysis.analyser.note_link(LinkNews(unit, LinkState.CONNECTED))
                found = await analysis.analyser.analyse(message, time.monotonic())
                analysis.recorder.put(found)
                await analysis.recorder.flush()
    finally:
        await analysis.close()
        store.close()
    return path


QUERIES = {
    "assessment": (
        "SELECT unit, bearing, assessment.* FROM assessment JOIN series ON series.id = series"
        " ORDER BY unit, bearing, time_ns"
    ),
    "gap": "SELECT * FROM gap ORDER BY unit, stop_ns, first_index",
    "alarm_event": (
        "SELECT * FROM alarm_event WHERE unit <> 'plant' AND kind NOT IN"
        " ('link_lost', 'clock_offset', 'clock_drift', 'time_stamps') ORDER BY alarm, number"
    ),
}

NUMBERS = ("id", "series", "layout", "seal")
"""What databases number as things come to them."""


def found_in(database: Path) -> dict[str, list[dict[str, object]]]:
    """Results, gaps and events of alarms, to the last bit; not what clocks of hosts have made."""
    with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as connection:
        connection.row_factory = sqlite3.Row
        found = {name: connection.execute(query).fetchall() for name, query in QUERIES.items()}
    return {
        name: [{key: row[key] for key in row.keys() if key not in NUMBERS} for row in rows]  # noqa: SIM118
        for name, rows in found.items()
    }


def positions(database: Path) -> dict[str, int]:
    """How far each unit is on the stream."""
    if not database.exists():
        return {}
    with closing(sqlite3.connect(f"file:{database}?mode=ro", uri=True)) as connection:
        try:
            rows = connection.execute("SELECT unit, sequence FROM stream_position").fetchall()
        except sqlite3.OperationalError:
            rows = []
    return dict(rows)
