"""What importing a file that means harm costs, and what is said of it."""

import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ImportJob

Read = Callable[[Path, ImportJob], Any]


READ = """
import json, resource, sys
from pathlib import Path
from pydantic import TypeAdapter
from acquisition.errors import ConfigError
from acquisition.recordings.imports.job import ImportJob
from acquisition.recordings.reading import close_idle_children, imported_blocks, imported_frames

job, said = TypeAdapter(ImportJob).validate_json(sys.argv[1]), []
for path in sys.argv[2:]:
    try:
        read = imported_blocks if job.channels else imported_frames
        said.append(str(sum(1 for _ in read(Path(path), job))))
    except ConfigError as error:
        said.append(str(error))
close_idle_children()
status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
own = int(status["VmHWM"].split()[0]) // 1024
child = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss // 1024
print(json.dumps([own, child, said]))
"""


def measured(job: ImportJob, *paths: Path) -> tuple[int, int, list[str]]:
    """Peaks of the importing and of the reading processes in MB, and what was said of each file."""
    command = [sys.executable, "-c", READ, json.dumps(asdict(job)), *map(str, paths)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=800, check=True)
    own_mb, child_mb, said = json.loads(result.stdout)
    return own_mb, child_mb, said


def refusal(read: Read, path: Path, job: ImportJob) -> str:
    with pytest.raises(ConfigError) as error:
        read(path, job)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 1500
    return str(error.value)


def write_hdf5(path: Path, **datasets: Any) -> None:
    with h5py.File(path, "w") as file:
        for name in ("time", "shaft x", "shaft y"):
            file[name] = datasets.get(name.replace(" ", "_"), np.arange(100) / 600.0)
