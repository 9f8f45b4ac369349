"""Disks that are full or slow: nothing promised is lost, and alarms go on meanwhile."""

import ctypes
import ctypes.util
import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from harness.bench import STORE_ALARM, Bench
from harness.service_rig import RefusedError, until

N_CYCLES, N_FEW = 20, 1
DISK_MIB = 32.0
RESUMED_WITHIN_S = 5.0
NOT_STORED = "results_not_stored"
CHUNK = b"\0" * 65_536

SLOW_US = 2_000_000
FROM_SYNC = 60
"""The first ones make the database."""

STRACE = (
    *("strace", "-D", "-f", "--seccomp-bpf", "-qq", "-o", "/dev/null", "-e", "trace=fdatasync"),
    *("-e", f"inject=fdatasync:delay_enter={SLOW_US}:when={FROM_SYNC}+"),
)


@contextmanager
def filled(disk: Path) -> Iterator[None]:
    """Leave nothing of a disk to others, for a while."""
    ballast = disk / "ballast"
    for size in (len(CHUNK), 512):
        with suppress(OSError), ballast.open("ab", buffering=0) as file:
            while file.write(CHUNK[:size]):
                pass
    yield
    ballast.unlink()


@contextmanager
def small_disk(folder: Path, mib: float) -> Iterator[Path]:
    """Mount a file system of its own on a folder; skips the test where that is not permitted."""
    folder.mkdir(parents=True, exist_ok=True)
    libc = ctypes.CDLL(ctypes.util.find_library("c"), use_errno=True)
    size = f"size={round(mib * 2**20)}".encode()
    if libc.mount(b"padwatch", os.fsencode(folder), b"tmpfs", 0, size) != 0:
        pytest.skip(f"needs a disk to mount: {os.strerror(ctypes.get_errno())}")
    try:
        yield folder
    finally:
        libc.umount2(os.fsencode(folder), 2)  # also if something is still open there


@pytest.mark.timeout(3600)
def test_a_full_disk_costs_nothing_that_was_promised(plant, daq, tmp_path, torture):
    with (
        small_disk(tmp_path / "small", DISK_MIB) as disk,
        Bench(*(plant, daq, tmp_path, STORE_ALARM, torture.period_s), data=disk / "data") as bench,
    ):
        bench.begin()
        bench.watch.wait_for_result()
        n_cycles = N_CYCLES if torture.is_whole else N_FEW
        resumed_s = [_filled_and_freed(bench, disk) for _ in range(n_cycles)]
        bench.watch.wait_for_result()
        found = bench.end()
    torture.figure(
        f"disk full and freed\n  cycles {len(resumed_s)}, stored again after at most"
        f" {max(resumed_s):.2f} s; {found.counts}"
    )
    assert found.wrong == {}
    assert found.n_results > 0
    assert not torture.is_whole or max(resumed_s) <= RESUMED_WITHIN_S


def _filled_and_freed(bench: Bench, disk: Path) -> float:
    """Fill the disk, look at the service, make room; seconds until results are stored again."""
    with bench.rig.api() as api:
        with filled(disk):
            alarm = until(lambda: bench.active(NOT_STORED))[0]["id"]
            bench.wait_for_newer()
            comment = {"actor": "Anna", "text": "is somebody there?"}
            with pytest.raises(RefusedError, match="Action not applied") as refused:
                api.post(f"/api/v1/alarms/{alarm}/comment", comment)
            assert refused.value.status == 503
        freed_s = time.monotonic()
        until(lambda: api.get("/readyz")["status"] == "ok")
    resumed_s = time.monotonic() - freed_s
    until(lambda: not bench.active(NOT_STORED))
    return resumed_s


@pytest.mark.timeout(900)
@pytest.mark.torture
@pytest.mark.skipif(shutil.which("strace") is None, reason="needs strace")
def test_a_slow_disk_holds_up_nothing_but_itself(plant, daq, tmp_path, torture):
    with Bench(plant, daq, tmp_path, STORE_ALARM, before=STRACE) as bench:
        bench.begin()
        [alarm] = until(lambda: bench.active(NOT_STORED))
        pace = [bench.wait_for_newer() for _ in range(3)]
        bench.watch.wait_for_result()
        found = bench.end()
    torture.figure(f"every sync takes {SLOW_US / 1e6:g} s\n  {found.counts}")
    assert alarm["condition_reason"] == "the store does not respond"
    assert len(set(pace)) == len(pace)
    assert found.wrong == {}
    assert found.n_results > 0
