"""A short, always equal slice of what `benchmarks/fuzz.py` does at length."""

import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).parents[2] / "benchmarks" / "fuzz.py"
PATIENCE_S = 280.0


@pytest.mark.long
def test_nothing_made_up_is_taken_for_a_valid_request_or_breaks_the_service():
    short = ["--examples", "1", "--phases", "examples,fuzzing", "--past-years", "0", "--no-daq"]
    command = [sys.executable, str(FUZZ), *short, "--seed", "7", "--roles", "admin"]

    fuzzed = subprocess.run(
        command, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )

    assert fuzzed.returncode == 0, fuzzed.stdout + fuzzed.stderr
    assert ", 0 wrong, 0 tracebacks" in fuzzed.stdout
