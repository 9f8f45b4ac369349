"""How full the disks are, when it is an alarm, and where a service keeps its results."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from rigs.command_line import padwatch
from structlog.testing import capture_logs

from acquisition.clock import Clock
from core.limits import AlarmLevel
from service.runtime.disk import DiskSpace, Growth, SpaceWatch, measure_disk
from service.settings.storage import SpaceSettings
from service.store.holds import FileSystem, exclusive_use
from service.store.port import StoreError

GB = 10**9
HOUR_S = 3600.0
ALERT, DANGER = AlarmLevel


class Disks:
    """Two disks, as full as a test says."""

    def __init__(self) -> None:
        self.free = {"data": 500 * GB, "captures": 50 * GB}
        self.total = {"data": 1000 * GB, "captures": 100 * GB}
        self.trouble: OSError | None = None

    def measure(self, folder: Path) -> DiskSpace:
        if self.trouble is not None:
            raise self.trouble
        name = folder.name if folder.name in self.free else "data"
        return DiskSpace(hash(name), self.total[name], self.free[name])


@pytest.fixture
def disks() -> Disks:
    return Disks()


@pytest.fixture
def watch(disks: Disks, stepped_clock: Clock) -> SpaceWatch:
    folders = {name: Path(name) for name in ("data", "captures", "evidence")}
    return SpaceWatch(folders, SpaceSettings(), stepped_clock, disks.measure)


def test_what_a_real_file_system_says_is_taken(tmp_path):
    there, yet_to_be_made = measure_disk(tmp_path), measure_disk(tmp_path / "a" / "b")

    assert 0 < there.free_bytes <= there.total_bytes
    assert there.device == yet_to_be_made.device == tmp_path.stat().st_dev


async def test_a_disk_with_room_is_no_alarm_and_each_disk_is_named_once(watch):
    await watch.look()

    assert watch.condition(None).level is None
    assert [disk.name for disk in watch.disks] == ["data", "captures"]
    assert str(watch) == "data: 500 of 1e+03 GB free; captures: 50 of 100 GB free"


@pytest.mark.parametrize(
    ("free_gb", "level"),
    [(11.0, None), (9.9, ALERT), (5.1, ALERT), (4.9, DANGER), (0.0, DANGER)],
)
async def test_the_fullest_disk_rules(watch, disks, free_gb, level):
    disks.free["captures"] = round(free_gb * GB)
    await watch.look()

    found = watch.condition(None)

    assert found.level is level
    assert found.value == pytest.approx(free_gb / 100.0)
    assert level is None or f"{free_gb:.3g} of 100 GB free" in found.reason


async def test_a_level_is_left_only_when_there_is_clearly_more_room(watch, disks):
    disks.free["captures"] = round(5.5 * GB)
    await watch.look()
    assert watch.condition(DANGER).level is DANGER
    disks.free["captures"] = round(6.1 * GB)
    await watch.look()
    assert watch.condition(DANGER).level is ALERT


async def test_a_disk_that_cannot_be_asked_is_not_taken_for_one_with_room(watch, disks):
    await watch.look()
    disks.trouble = OSError(5, "Input/output error")
    await watch.look()

    found = watch.condition(ALERT)

    assert not found.is_known
    assert "Input/output error" in found.reason
    assert "Input/output error" in str(watch)


@given(st.integers(1, 10**16))
def test_limits_fit_every_disk(total_bytes):
    limits = SpaceSettings().limits(total_bytes)

    assert limits.passed(1.0, None) is None
    assert limits.passed(0.5, AlarmLevel.DANGER) is None
    assert limits.passed(0.0, None) is DANGER


def test_gigabytes_rule_where_a_share_of_the_disk_is_too_little():
    limits = SpaceSettings().limits(10 * GB)
    assert limits.passed(0.15, None) is ALERT
    assert limits.passed(0.09, None) is DANGER


def test_it_is_told_when_the_disk_will_be_full():
    growth, free = Growth(), 100 * GB
    for hour in range(49):
        space = DiskSpace(1, 1000 * GB, free - hour * GB)
        growth.note(space, hour * HOUR_S)
    assert growth.days_until_full(space, 48 * HOUR_S) == pytest.approx(52.0 / 24.0)


def test_nothing_is_foretold_from_minutes_or_of_what_does_not_grow():
    growth = Growth()
    growth.note(DiskSpace(1, 100 * GB, 50 * GB), 0.0)
    assert growth.days_until_full(DiskSpace(1, 100 * GB, 40 * GB), 1800.0) is None
    assert growth.days_until_full(DiskSpace(1, 100 * GB, 60 * GB), 90_000.0) is None


@pytest.mark.parametrize("unit", ["share", "gb"])
def test_a_danger_that_comes_before_its_alert_is_refused(unit):
    asked = {f"danger_free_{unit}": 0.5, f"alert_free_{unit}": 0.4}
    with pytest.raises(ValidationError, match=f"must be below alert_free_{unit} = 0.4"):
        SpaceSettings.model_validate(asked)


def test_a_data_folder_on_a_network_file_system_is_refused_with_what_to_do(tmp_path):
    database = tmp_path / "data" / "padwatch.sqlite3"
    said = r"data is on a network file system \(nfs4\).*: choose a data folder on a local disk"

    with (
        pytest.raises(StoreError, match=said),
        exclusive_use(database, lambda _: FileSystem("nfs4", is_remote=True)),
    ):
        pytest.fail("it was let in")

    assert not database.parent.exists()


def test_a_data_folder_that_may_forget_is_warned_of_and_a_local_disk_is_not(tmp_path):
    for found in (FileSystem("ext4"), FileSystem("tmpfs", warning="is memory")):
        with capture_logs() as logs, exclusive_use(tmp_path / "x", lambda _, found=found: found):
            pass
        warned = [(entry["log_level"], entry["why"]) for entry in logs]
        assert warned == ([("warning", found.warning)] if found.warning else [])


def test_a_second_service_on_the_same_data_is_refused_in_one_line(plant_path):
    plant_path.write_text(plant_path.read_text().replace("port = 0", "port = 9"))
    with exclusive_use(plant_path.parent / "data" / "padwatch.sqlite3"):
        found = padwatch("run", plant_path, "--port", "0")
    assert (found.exit_code, found.stderr.count("\n")) == (1, 1)
    assert f"another padwatch (process {os.getpid()}) uses" in found.stderr
