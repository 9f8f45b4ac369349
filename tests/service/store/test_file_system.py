"""What kind of file system a data folder is on."""

from pathlib import Path

import pytest

from service.store.file_system import OVER_A_NETWORK, FileSystem, file_system_of

ROOT = "22 1 254:0 / / rw,relatime shared:1 - ext4 /dev/vda rw"


def mounts(*kinds: tuple[str, str]) -> str:
    """A table in which folders are mounted, in order, as the kernel writes it."""
    lines = [
        f"{30 + n} 22 0:{n} / {point} rw,nosuid shared:{n} - {kind} server:/share rw"
        for n, (point, kind) in enumerate(kinds)
    ]
    return "\n".join([ROOT, *lines])


LOCAL = ("ext4", "xfs", "btrfs", "zfs", "f2fs")
FORGETFUL = ("tmpfs", "overlay", "vfat", "virtiofs", "fuse.encfs", "fuseblk")


@pytest.mark.parametrize("kind", [*sorted(OVER_A_NETWORK), *LOCAL, *FORGETFUL])
def test_a_folder_on_another_machine_or_one_that_may_forget_is_known_as_such(kind: str) -> None:
    found = file_system_of(Path("/plant/data"), lambda: mounts(("/plant", kind)))

    assert (found.kind, found.is_remote) == (kind, kind in OVER_A_NETWORK)
    if kind in LOCAL:
        assert found == FileSystem(kind)
    if kind in FORGETFUL:
        assert found.warning


def test_the_nearest_mount_counts_and_of_one_place_the_latest() -> None:
    table = mounts(("/a", "nfs4"), ("/a/b", "xfs"), ("/ab", "cifs"), ("/c", "xfs"), ("/c", "nfs"))
    kinds = {p: file_system_of(Path(p), lambda: table).kind for p in ("/a", "/a/b/d", "/abc", "/c")}

    assert kinds == {"/a": "nfs4", "/a/b/d": "xfs", "/abc": "ext4", "/c": "nfs"}


def test_a_link_leads_to_where_it_points(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "near").symlink_to(tmp_path / "far")
    table = mounts((str(tmp_path / "far"), "nfs4"))

    assert file_system_of(tmp_path / "near", lambda: table).is_remote


def test_a_mount_with_a_space_in_its_name_is_found() -> None:
    table = mounts((r"/my\040plant", "nfs4"))

    assert file_system_of(Path("/my plant/data"), lambda: table).kind == "nfs4"


@pytest.mark.parametrize("table", ["", "nonsense", "1 2 3 4\n - \n"])
def test_a_system_that_does_not_say_is_not_guessed_at(table: str) -> None:
    assert file_system_of(Path("/plant"), lambda: table) == FileSystem("")


def test_this_machine_says_what_it_keeps_files_on(tmp_path: Path) -> None:
    if not Path("/proc/self/mountinfo").exists():
        pytest.skip("the kernel has no table of mounts")
    assert file_system_of(tmp_path).kind
