"""Modules that the measuring and the serving process load."""

import subprocess
import sys

import pytest

MEASURING = [
    "service.app.measuring_process",
    "service.app.analysis",
    "service.app.cluster_processes",
]
SERVING = ["service.app.serving_process", "service.app.replica_process"]
HTTP = ["fastapi", "starlette", "uvicorn", "jinja2", "matplotlib", "service.api"]
ANALYSIS = ["service.measuring", "core.monitor.monitor", "core.stiffness.dynamic", "scipy"]


@pytest.mark.parametrize(("processes", "others"), [(MEASURING, HTTP), (SERVING, ANALYSIS)])
def test_a_process_loads_nothing_of_the_other(processes, others):
    program = f"import {', '.join(processes)}, sys; print(*sys.modules)"
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    loaded = set(ended.stdout.split())
    assert loaded >= {*processes}
    assert not loaded & set(others)
