"""A service keeps its results only where they are kept, and alone."""

import os
from pathlib import Path

import pytest
from rigs.command_line import padwatch
from structlog.testing import capture_logs

from service.store.holds import FileSystem, exclusive_use
from service.store.port import StoreError


def test_a_data_folder_on_a_network_file_system_is_refused_with_what_to_do(tmp_path: Path) -> None:
    database = tmp_path / "data" / "padwatch.sqlite3"
    said = r"data is on a network file system \(nfs4\).*: choose a data folder on a local disk"

    with (
        pytest.raises(StoreError, match=said),
        exclusive_use(database, lambda _: FileSystem("nfs4", is_remote=True)),
    ):
        pytest.fail("it was let in")

    assert not database.parent.exists()


def test_a_data_folder_that_may_forget_is_warned_of_and_a_local_disk_is_not(tmp_path: Path) -> None:
    for found in (FileSystem("ext4"), FileSystem("tmpfs", warning="is memory")):
        with capture_logs() as logs, exclusive_use(tmp_path / "x", lambda _, found=found: found):
            pass
        warned = [(entry["log_level"], entry["why"]) for entry in logs]
        assert warned == ([("warning", found.warning)] if found.warning else [])


def test_a_second_service_on_the_same_data_is_refused_in_one_line(plant_path: Path) -> None:
    plant_path.write_text(plant_path.read_text().replace("port = 0", "port = 9"))
    with exclusive_use(plant_path.parent / "data" / "padwatch.sqlite3"):
        found = padwatch("run", plant_path, "--port", "0")
    assert (found.exit_code, found.stderr.count("\n")) == (1, 1)
    assert f"another padwatch (process {os.getpid()}) uses" in found.stderr
