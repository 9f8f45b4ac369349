"""Reading foreign files: libraries that are missing, and limits of the reading process."""

import subprocess
import sys

import pytest

from acquisition.errors import ConfigError
from acquisition.recordings.imports.times import library

CONFINED = """
import resource
from acquisition.recordings.confined import confine

resource.setrlimit(resource.RLIMIT_AS, ({given}, {given}))
confine(2**31, 60, 1000)
print(*(resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_FSIZE)))
"""


@pytest.mark.parametrize(("given", "memory"), [(2**33, 2**31), (2**30, 2**30)])
def test_limits_are_never_raised(given: int, memory: int) -> None:
    script = CONFINED.format(given=given)
    command = [sys.executable, "-c", script]
    found = subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)
    assert found.stdout.split() == [str(memory), "1000"]


def test_a_library_that_is_not_installed_is_named_with_how_to_get_it() -> None:
    with pytest.raises(
        ConfigError, match=r"^XYZ needs absent_one: pip install 'padwatch\[imports\]'$"
    ):
        library("absent_one", "XYZ")
