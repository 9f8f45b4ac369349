"""`padwatch recording info|verify|export|import` as a user sees them."""

import json
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest
from click.testing import Result
from rigs.blocks import cell_block
from rigs.command_line import padwatch
from rigs.tiers import first_fast

from acquisition.can.settings import CanLinkSettings, CanSettings
from acquisition.delivery.blocks import BlockJoiner
from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ImportJob, TimeAxis
from acquisition.recordings.reader import open_recording
from acquisition.recordings.reading import imported_frames
from acquisition.simulated.devices.can_device import CanDevice
from acquisition.simulated.devices.can_frames import WireFrame
from acquisition.simulated.devices.can_shape import CanShape, DaqSignal, daq_dbc, daq_settings
from acquisition.simulated.feed import FeedEndedError
from core.samples.blocks import Rejection, SampleBlock, SideValues
from core.samples.calibration import UnitCalibration
from service.app.recordings import recording_writer
from service.cli.offline.importing import CanLogDecoder
from service.settings.core_values import calibration_of
from service.settings.plant import load_plant_file
from service.settings.units import UnitSettings

START_NS = 1_767_225_600_000_000_000


def padwatch_recording(*arguments: object) -> Result:
    return padwatch("recording", *arguments)


@pytest.fixture
def unit(plant_path: Path) -> UnitSettings:
    return load_plant_file(plant_path).unit[0]


def raw_block(
    unit: UnitSettings, first_index: int, epoch: int = 1, **changes: object
) -> SampleBlock:
    n_channels = len(unit.channel)
    index = np.arange(first_index, first_index + 50)
    values: dict[str, object] = {
        "epoch": epoch,
        "first_index": first_index,
        "start_ns": START_NS + first_index * 10**7 // 6 // 1000 * 1000,
        "rate_hz": 600.0,
        "counts": (index + 1000 * np.arange(1, n_channels + 1)[:, np.newaxis]).astype(np.int16),
        "ok": (True,) * n_channels,
        "slow": tuple(20.0 + n for n in range(len(unit.slow_channel))),
        "calibration": calibration_of(unit),
    }
    return cell_block(**(values | changes))


@pytest.fixture
def folder(unit: UnitSettings, tmp_path: Path) -> Path:
    """A gap of 200 samples, of which 20 were rejected, a channel not OK, and a restart."""
    with recording_writer(unit, tmp_path / "run", "a test") as writer:
        writer.write(raw_block(unit, 0))
        writer.write(raw_block(unit, 50, ok=(False,) + (True,) * (len(unit.channel) - 1)))
        writer.write(raw_block(unit, 300, rejected=(Rejection("torn", 20),)))
        late_ns = START_NS + 30_000_834_000
        writer.write(raw_block(unit, 0, epoch=2, start_ns=late_ns))
    return tmp_path / "run"


def test_info_counts_gaps_rejections_and_restarts_exactly(folder, unit):
    told = json.loads(padwatch_recording("info", folder, "--json").stdout)
    assert (told["unit"], told["sample_type"], told["rate_hz"]) == ("U1", "int16", 600.0)
    counted = [told[name] for name in ("samples", "offered", "gaps", "gap_samples")]
    assert counted == [200, 400, 1, 180]
    assert told["gap_list"] == [
        {"epoch": 1, "first_index": 100, "samples": 180, "end": "2026-01-01T00:00:00.500Z"}
    ]
    assert told["rejected"] == {"torn": 20}
    assert told["epochs"] == [1, 2]
    assert told["not_ok"] == {unit.channel[0].id: 50}
    assert [c["id"] for c in told["channels"]] == [c.id for c in unit.channel]
    assert told["channels"][0]["unit"] == "um"
    assert len(told["files"]["samples.parquet"]["sha256"]) == 64


def test_missing_parent_folders_of_a_recording_are_created(unit, tmp_path):
    with recording_writer(unit, tmp_path / "runs" / "march" / "run42", "a test") as writer:
        writer.write(raw_block(unit, 0))
    assert padwatch_recording("verify", tmp_path / "runs" / "march" / "run42").exit_code == 0


def test_info_for_people_says_the_same(folder):
    result = padwatch_recording("info", folder)
    assert result.exit_code == 0
    for line in (
        "  from         2026-01-01T00:00:00.000Z",
        "  samples      200 of 400 per channel",
        "  gaps         1, 180 samples",
        "    180 samples from index 100, to 2026-01-01T00:00:00.500Z",
        "  rejected     20 samples: torn",
        "  restarts     1 of the device's sample count",
        "  not OK       50 samples of ujb_shaft_x",
    ):
        assert f"{line}\n" in result.stdout


def test_verify_reads_every_page(folder):
    result = padwatch_recording("verify", folder)
    assert (result.exit_code, result.stdout) == (
        0,
        f"{folder}: intact, 200 samples of each channel\n",
    )
    assert json.loads(padwatch_recording("verify", folder, "--json").stdout) == {
        "folder": str(folder),
        "sound": True,
        "samples": 200,
    }


@pytest.mark.parametrize("command", ["info", "verify"])
def test_a_damaged_recording_is_one_sentence_and_exit_code_1(folder, command):
    content = bytearray((folder / "samples.parquet").read_bytes())
    content[100] ^= 1
    (folder / "samples.parquet").write_bytes(content)
    result = padwatch_recording(command, folder)
    assert (result.exit_code, result.stdout) == (1, "")
    damaged = (
        f"padwatch recording {command}: {folder}/samples.parquet: file is damaged: its checksum is"
    )
    assert result.stderr.startswith(damaged)
    assert result.stderr.count("\n") == 1


MAPPING = """\
format = "csv"

[time]
source = "column"
column = "time_utc"
form = "iso8601"
zone = "UTC"
"""

UNITS = {"gap_um": "um", "velocity_mm_s": "mm/s", "acceleration_m_s2": "m/s2", "key_phase_v": "V"}


def mapping_of(unit: UnitSettings) -> str:
    """As a user writes it who knows what padwatch exports."""
    text = MAPPING
    for channel in unit.channel:
        name = UNITS[channel.measurand]
        text += f'\n[[channel]]\nid = "{channel.id}"\ncolumn = "{channel.id} [{name}]"\n'
        text += f'unit = "{name}"\n'
    for slow in unit.slow_channel:
        text += f'\n[[slow_channel]]\nid = "{slow.id}"\ncolumn = "{slow.id} [{slow.unit}]"\n'
        text += f'unit = "{slow.unit}"\n'
    return text


def test_what_is_exported_can_be_imported_again(folder, plant_path, unit, tmp_path):
    result = padwatch_recording("export", folder, "--format", "csv", "--out", tmp_path / "run.csv")
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == f"{tmp_path}/run.csv: 200 samples of each channel\n"
    (tmp_path / "map.toml").write_text(mapping_of(unit))
    plain = ("--mapping", tmp_path / "map.toml", "--plant", plant_path, "--unit", "U1")
    result = padwatch_recording(
        "import", tmp_path / "run.csv", *plain, "--out", tmp_path / "again", "--json"
    )
    assert (result.exit_code, result.stderr) == (0, "")
    told = json.loads(result.stdout)
    assert (told["samples"], told["gap_samples"], told["sample_type"]) == (200, 200, "float32")
    again = open_recording(tmp_path / "again")
    before, after = (
        [cell for block in recording.blocks() for cell in block.cells()]
        for recording in (open_recording(folder), again)
    )
    for first, second in zip(before, after, strict=True):
        assert (first.start_ns, first.first_index) == (second.start_ns, second.first_index)
        assert first.slow == second.slow
        good = [quality.level == 0 for quality in first.channel_quality]
        assert any(good)
        np.testing.assert_array_equal(first.samples[good], second.samples[good])
        assert [quality.level == 0 for quality in second.channel_quality] == good


@pytest.mark.parametrize(
    ("old", "new", "code", "words"),
    [
        ('unit = "um"', 'unit = "mm/s"', 1, "ujb_shaft_x: unit 'mm/s' cannot be converted to gap"),
        ("ujb_shaft_x", "ujb_shaft_z", 1, "ujb_shaft_z is mapped, but unit U1 has only ujb_shaft"),
        ('zone = "UTC"', "", 2, "time.zone is missing; give"),
        (
            'unit = "r/min"',
            'unit = "degF"',
            1,
            "unit 'degF' cannot be converted to r/min; use one of r/min, Hz",
        ),
    ],
)
def test_a_mapping_that_does_not_fit_is_refused_and_leaves_nothing(
    folder, plant_path, unit, tmp_path, old, new, code, words
):
    padwatch_recording("export", folder, "--format", "csv", "--out", tmp_path / "run.csv")
    text = mapping_of(unit)
    assert old in text
    (tmp_path / "map.toml").write_text(text.replace(old, new, 1))
    plain = ("--mapping", tmp_path / "map.toml", "--plant", plant_path, "--unit", "U1")
    result = padwatch_recording("import", tmp_path / "run.csv", *plain, "--out", tmp_path / "again")
    assert (result.exit_code, result.stdout) == (code, "")
    assert words in result.stderr
    assert result.stderr.count("\n") == 1
    assert not list(tmp_path.glob("again*"))


START_S = 1_767_225_600


class GappyFeed:
    """The counting feed with holes, a sick channel and slow values that change."""

    def __init__(self, feed) -> None:
        self._feed, self.sent = feed, []

    def advance(self, n_samples: int) -> SampleBlock:
        number = len(self.sent)
        if number == 200:
            raise FeedEndedError
        if number % 30 == 29:
            self._feed.advance(7 * number)
        raw = self._feed.advance(n_samples)
        ok = (True, number % 13 != 0)
        stamp_ns = raw.start_ns // 1000 * 1000
        side = SideValues.of(stamp_ns, ok, (40.0 + number, float("nan")))
        self.sent.append(replace(raw, side=side))
        return self.sent[-1]


@pytest.mark.parametrize("kind", ["candump", "blf"])
@pytest.mark.parametrize("fd", first_fast(1, [False, True]))
def test_every_sample_flag_and_stamp_comes_back(
    counting_feed, counts_calibration, tmp_path, kind, fd
):
    shape = CanShape(
        channels=(DaqSignal("c0", "V", 1.0), DaqSignal("c1", "V", 1.0)),
        slow=(DaqSignal("slow0", "degC"), DaqSignal("slow1", "degC")),
        fd=fd,
    )
    feed = GappyFeed(counting_feed())
    device = CanDevice(feed, shape)
    write_log(tmp_path / "log", kind, device)
    (tmp_path / "daq.dbc").write_text(daq_dbc(shape), encoding="utf-8")
    link = CanLinkSettings(interface="virtual", channel="none", fd=fd)
    settings: CanSettings = daq_settings(shape, link, ("um", "um"))
    decoder = CanLogDecoder(settings, counts_calibration())
    job = ImportJob(format=kind, rate_hz=600.0, time=TimeAxis("file", 0))
    read = imported_frames(tmp_path / "log", job)
    raws = [raw for frames, _ in read for raw in decoder.take(frames)]
    assert on_grid(raws, counts_calibration()) == on_grid(feed.sent, counts_calibration())


def test_a_log_of_two_devices_of_one_id_is_refused(counting_feed, counts_calibration, tmp_path):
    shape = CanShape(
        channels=(DaqSignal("c0", "V", 1.0), DaqSignal("c1", "V", 1.0)),
        slow=(DaqSignal("slow0", "degC"), DaqSignal("slow1", "degC")),
    )
    one, other = (CanDevice(GappyFeed(counting_feed()), shape) for _ in range(2))
    for _ in range(20):  # of the same make, and on for a little longer
        other.next_frames()
        other.produce()
    write_log(tmp_path / "log", "candump", one, other)
    link = CanLinkSettings(interface="virtual", channel="none")
    decoder = CanLogDecoder(daq_settings(shape, link, ("um", "um")), counts_calibration())
    job = ImportJob(format="candump", rate_hz=600.0, time=TimeAxis("file", 0))
    every_batch = (decoder.take(frames) for frames, _ in imported_frames(tmp_path / "log", job))
    with pytest.raises(ConfigError, match="do two devices send the same CAN ids"):
        list(every_batch)


def write_log(path: Path, kind: str, *devices: CanDevice) -> None:
    writer = can.CanutilsLogWriter if kind == "candump" else can.BLFWriter
    with writer(path) as log:
        n_frames = 0
        while all(device.has_frames for device in devices):
            for frame in (frame for device in devices for frame in device.next_frames()):
                log(as_message(frame, n_frames))
                n_frames += 1
            for device in devices:
                device.produce()


def as_message(frame: WireFrame, number: int) -> can.Message:
    return can.Message(
        timestamp=START_S + number * 1e-4,
        arbitration_id=frame.frame_id,
        is_extended_id=frame.extended,
        is_fd=frame.fd,
        data=frame.data,
    )


def on_grid(raws: list[SampleBlock], calibration: UnitCalibration) -> list[SampleBlock]:
    joiner = BlockJoiner(50)
    blocks = [b for raw in raws for b in joiner.put([replace(raw, calibration=calibration)])]
    return blocks + joiner.flush()
