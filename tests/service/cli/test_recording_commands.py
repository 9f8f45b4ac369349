"""`padwatch record` and `padwatch reanalyse`."""

import asyncio
import json
import signal
from collections.abc import AsyncGenerator, AsyncIterator, Callable
from contextlib import aclosing, asynccontextmanager
from pathlib import Path

import pytest
from pydantic_core import to_jsonable_python
from rigs.command_line import padwatch, padwatch_program

from acquisition.clock import SystemClock
from acquisition.errors import LinkError
from acquisition.recordings.reader import open_recording
from acquisition.recordings.source import RecordingSource
from core.monitor.monitor import UnitMonitor
from core.samples.blocks import SampleBlock
from service.app.recordings import recording_writer, selection_of
from service.app.storage import database_path
from service.cli.offline.reanalysis import assessment_document, refreshes
from service.cli.record import ReconnectPolicy, record_blocks
from service.measuring.simulated_sources import simulated_feed as feed_of
from service.settings.core_values import analysis_of, calibration_of, machine_of
from service.settings.plant import PlantFile, load_plant_file
from service.settings.units import UnitSettings
from service.store.holds import exclusive_use

SMALL = "[analysis]\nsegment_samples = 4096\nn_segments = 4\n\n[service]"


@pytest.fixture
def plant_path(plant_text: str, tmp_path: Path) -> Path:
    """The demonstration plant, simulated in this process, with short segments."""
    wire = 'kind = "modbus_ring"\nhost = "127.0.0.1"\nport = 0'
    assert wire in plant_text
    path = tmp_path / "plant.toml"
    simulated = plant_text.replace(wire, 'kind = "simulated"').replace("[service]", SMALL)
    path.write_text(simulated, encoding="utf-8")
    return path


@pytest.fixture
def plant(plant_path: Path) -> PlantFile:
    return load_plant_file(plant_path)


@pytest.fixture
def recording(plant: PlantFile, tmp_path: Path) -> Path:
    """Half a minute of unit U1: five segments of its analysis."""
    feed = feed_of(plant.unit[0], SystemClock())
    with recording_writer(plant.unit[0], tmp_path / "run", "a test") as writer:
        for _ in range(310):
            writer.write(feed.advance(60))
    return tmp_path / "run"


def test_samples_are_not_taken_from_the_queue_that_a_running_service_reads(plant_path, tmp_path):
    queue = 'kind = "modbus_fifo"\nhost = "127.0.0.1"\nlayout = "per_channel"\naddresses = '
    queue += str([*range(1, 13)])
    text = plant_path.read_text(encoding="utf-8").replace('kind = "simulated"', queue)
    plant_path.write_text(text, encoding="utf-8")
    with exclusive_use(database_path(load_plant_file(plant_path))):
        result = padwatch("record", plant_path, "--unit", "U1", "--out", tmp_path / "run")
    assert (result.exit_code, "another padwatch" in result.output) == (1, True), result.output


@pytest.mark.long
def test_a_recorded_unit_can_be_read_back(plant_path, tmp_path):
    out = tmp_path / "run"
    command = ("record", plant_path, "--unit", "U2", "--seconds", 0.5, "--out", out)
    result = padwatch_program(*command)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == f"{out}: 0.5 s of unit U2, 12 channels, 0.0 MB\n"
    manifest = open_recording(out).manifest
    assert (manifest.unit, manifest.n_samples, manifest.n_blocks) == ("U2", 300, 6)
    assert manifest.made_by.startswith("padwatch 0")

    again = padwatch(*command)
    assert (again.exit_code, again.stdout) == (1, "")
    assert again.stderr == (
        f"padwatch record: {out}: folder exists already; a recording is not overwritten\n"
    )


class Interrupted:
    """A simulated unit; after some blocks something happens, and what passes then is missed."""

    def __init__(self, unit: UnitSettings, n_blocks: int, event: Callable[[], None]) -> None:
        self._feed, self._calibration = feed_of(unit, SystemClock()), calibration_of(unit)
        self._n_blocks, self._event = n_blocks, event

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[AsyncIterator[SampleBlock]]:
        async with aclosing(self._blocks()) as blocks:
            yield blocks

    async def _blocks(self) -> AsyncGenerator[SampleBlock]:
        for _ in range(self._n_blocks):
            await asyncio.sleep(0)
            yield self._feed.advance(50)
        self._feed.advance(100)
        self._event()
        await asyncio.Event().wait()


def lose_the_link() -> None:
    raise LinkError("cable cut")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
async def test_ending_a_recording_early_keeps_it(plant, tmp_path, number):
    unit = plant.unit[0]
    source = Interrupted(unit, 3, lambda: signal.raise_signal(number))
    writer = recording_writer(unit, tmp_path / "run", "a test")
    assert await record_blocks(source, writer, seconds=600.0) is None
    assert open_recording(tmp_path / "run").manifest.n_samples == 150


@pytest.mark.parametrize("patience_s", [None, 0.2])
async def test_a_link_that_stays_lost_ends_a_recording_and_keeps_it(
    plant, tmp_path, stepped_clock, patience_s
):
    unit = plant.unit[0]
    writer = recording_writer(unit, tmp_path / "run", "a test")
    policy = None if patience_s is None else ReconnectPolicy(patience_s, stepped_clock)
    source = Interrupted(unit, 2, lose_the_link)
    assert await record_blocks(source, writer, 600.0, policy) == "cable cut"
    # with a policy it is asked once more, which is after the 0.2 s
    assert open_recording(tmp_path / "run").manifest.n_samples == (100 if policy is None else 200)


async def test_a_lost_link_may_be_recorded_across_as_an_exact_gap(plant, tmp_path, stepped_clock):
    unit = plant.unit[0]
    writer = recording_writer(unit, tmp_path / "run", "a test")
    policy = ReconnectPolicy(10.0, stepped_clock)
    assert await record_blocks(Interrupted(unit, 2, lose_the_link), writer, 1.0, policy) is None
    found = [
        (block.first_index, block.n_samples) for block in open_recording(tmp_path / "run").blocks()
    ]
    assert found == [(0, 100), (200, 100), (400, 100), (600, 50)]


def test_no_source_leaves_no_recording(plant_path, tmp_path):
    text = plant_path.read_text().replace(
        'kind = "simulated"', 'kind = "modbus_ring"\nhost = "127.0.0.1"\nport = 1'
    )
    plant_path.write_text(text)
    result = padwatch("record", plant_path, "--unit", "U1", "--out", tmp_path / "run")
    assert result.exit_code == 1
    assert result.stderr.startswith("padwatch record: 127.0.0.1:1: ")
    assert result.stderr.count("\n") == 1
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plant.toml"]


def test_a_unit_has_to_be_chosen_and_to_exist(plant_path, tmp_path):
    result = padwatch("record", plant_path, "--out", tmp_path / "run")
    assert (result.exit_code, result.stderr) == (
        2,
        f"padwatch record: {plant_path}: choose one of the units U1, U2 with --unit\n",
    )
    result = padwatch("record", plant_path, "--unit", "U3", "--out", tmp_path / "run")
    assert (result.exit_code, result.stderr) == (
        2,
        f"padwatch record: {plant_path}: unknown unit U3; known units: U1, U2\n",
    )


async def test_the_command_prints_every_assessment_of_the_analysis_to_the_last_digit(
    plant, plant_path, recording
):
    command = ("reanalyse", recording, "--plant", plant_path, "--json")
    result = await asyncio.to_thread(padwatch, *command)
    assert (result.exit_code, result.stderr) == (0, "")

    opened, unit = open_recording(recording), plant.unit[0]
    source = RecordingSource(opened, SystemClock(), selection_of(opened, unit))
    monitor = UnitMonitor(machine_of(unit), analysis_of(plant.analysis))
    expected = [
        to_jsonable_python(assessment_document(found.assessment()))
        async for found in refreshes(source, monitor, lambda _: None)
    ]
    assert len(expected) == 3 * 5
    assert json.loads(result.stdout) == expected

    last = await asyncio.to_thread(padwatch, *command, "--window", "last")
    assert json.loads(last.stdout) == expected[-3:]


def test_people_get_a_table_for_each_bearing(plant_path, recording):
    result = padwatch("reanalyse", recording, "--plant", plant_path)
    assert (result.exit_code, result.stderr) == (0, "")
    for bearing in ("UJB", "LJB", "TJB"):
        assert f"\nU1 {bearing}, " in result.stdout
    assert result.stdout.count("4 of 4 segments") == 3
    assert "N/m" in result.stdout


def test_another_calibration_is_told_and_used_only_when_asked_for(plant_path, recording):
    text = plant_path.read_text()
    plant_path.write_text(text.replace("sensitivity = 4.0", "sensitivity = 3.9", 1))

    def shaft_x(*options: str) -> tuple[float, str]:
        result = padwatch("reanalyse", recording, "--plant", plant_path, "--json", *options)
        readings = json.loads(result.stdout)[0]["readings"]
        return readings["order1_shaft_x_um_pk"]["value"], result.stderr

    before, told = shaft_x()
    after, told_again = shaft_x("--calibration", "plant")
    assert after / before == pytest.approx(4.0 / 3.9, rel=1e-6)
    words = "channel ujb_shaft_x: unit_per_v was 250 when recorded, is 256.410256 now; the"
    assert told == f"{recording}: {words} recorded calibration is used\n"
    assert told_again == f"{recording}: {words} plant calibration is used\n"


def test_a_recording_too_short_for_a_segment_says_so(plant, plant_path, tmp_path):
    with recording_writer(plant.unit[0], tmp_path / "short", "a test") as writer:
        writer.write(feed_of(plant.unit[0], SystemClock()).advance(4095))
    result = padwatch("reanalyse", tmp_path / "short", "--plant", plant_path)
    assert (result.exit_code, result.stdout) == (1, ""), result.stderr
    assert "no 4096 consecutive samples are without gap" in result.stderr
