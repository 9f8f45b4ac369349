"""Reading foreign files: libraries that are missing, limits and ends of the reading process."""

import errno
import io
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from unittest.mock import Mock

import pyarrow.parquet as pq
import pytest

from acquisition.delivery.blocks import RawBlock
from acquisition.errors import ConfigError
from acquisition.recordings import reading
from acquisition.recordings.child import answer
from acquisition.recordings.confined import ConfinedProcess
from acquisition.recordings.imports.times import library
from acquisition.recordings.messages import receive
from acquisition.recordings.reader import open_recording

Record = Callable[..., Path]
Numbered = Callable[..., RawBlock]

CONFINED = """
import resource
from acquisition.recordings.confined import confine

resource.setrlimit(resource.RLIMIT_AS, ({given}, {given}))
confine(2**31)
print(*(resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_FSIZE)))
"""


@pytest.mark.parametrize(("given", "memory"), [(2**33, 2**31), (2**30, 2**30)])
def test_limits_are_never_raised(given: int, memory: int) -> None:
    script = CONFINED.format(given=given)
    command = [sys.executable, "-c", script]
    found = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert found.stdout.split() == [str(memory), "1000000"]


def test_a_library_that_is_not_installed_is_named_with_how_to_get_it() -> None:
    with pytest.raises(
        ConfigError,
        match=r"^importing XYZ requires absent_one; run pip install 'padwatch\[imports\]'$",
    ):
        library("absent_one", "XYZ")


@pytest.mark.parametrize(
    ("number", "cause"),
    [("SIGKILL", InterruptedError), ("SIGTERM", InterruptedError), ("SIGSEGV", EOFError)],
)
def test_a_child_that_the_system_has_ended_is_no_fault_of_the_recording(
    record: Record,
    numbered: Numbered,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    number: str,
    cause: type,
) -> None:
    recording = open_recording(record([numbered(0, 50)]))
    (tmp_path / "ended.py").write_text(f"import os, signal; os.kill(os.getpid(), signal.{number})")
    monkeypatch.syspath_prepend(tmp_path)
    with monkeypatch.context() as patch:
        ended = partial(ConfinedProcess, "ended")
        patch.setattr(reading, "_idle_or_new", ended)
        with pytest.raises(
            ConfigError, match=f"recording: the reading process was ended by {number}"
        ) as it:
            list(recording.heads())
    assert isinstance(it.value.__cause__, cause)
    with monkeypatch.context() as patch:
        patch.setattr(reading, "ConfinedProcess", lambda *_, **__: ended())
        reading.close_idle_children()
        with pytest.raises(
            ConfigError, match=f"reading process cannot be started: .*{number}"
        ) as it:
            list(recording.heads())
    assert isinstance(it.value.__cause__, OSError)
    assert len(list(recording.heads())) == 1


CRASHES = """
import os, select, signal
select.select([0], [], [])
os.kill(os.getpid(), signal.SIGSEGV)
"""


def test_a_crash_that_leaves_the_request_unread_is_a_refusal_too(
    record: Record, numbered: Numbered, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The parent's next read is then a reset of the connection, no end of the stream."""
    recording = open_recording(record([numbered(0, 50)]))
    (tmp_path / "crashes.py").write_text(CRASHES)
    monkeypatch.syspath_prepend(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr(reading, "_idle_or_new", partial(ConfinedProcess, "crashes"))
        words = "recording: cannot be read as recording: the reading process was ended by SIGSEGV"
        with pytest.raises(ConfigError, match=words) as error:
            list(recording.heads())
    assert isinstance(error.value.__cause__, EOFError)  # of the file, not of the system
    assert len(list(recording.heads())) == 1


def test_what_is_not_read_to_its_end_is_never_taken_for_the_next(
    record: Record, numbered: Numbered
) -> None:
    recording = open_recording(record([numbered(50 * n, 50) for n in range(600)]))
    blocks = recording.raw_blocks()
    assert next(blocks).first_index == 0
    blocks.close()
    found = [block.first_index for block in recording.raw_blocks(500)]
    assert found == list(range(25_000, 30_000, 50))


def test_an_error_of_the_disk_keeps_its_number(
    record: Record, numbered: Numbered, monkeypatch: pytest.MonkeyPatch
) -> None:
    fails = Mock(side_effect=OSError(errno.EIO, "Input/output error"))
    recording = open_recording(record([numbered(0, 50)]))
    monkeypatch.setattr(pq, "ParquetFile", fails)
    request = {"manifest": recording.manifest.model_dump(mode="json"), "first": 0, "stop": 1}
    out = io.BytesIO()
    answer({"path": str(recording.folder), "format": "recording", "samples": True} | request, out)
    out.seek(0)
    assert receive(out)[0]["errno"] == errno.EIO
