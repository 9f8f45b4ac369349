"""Who made a file, for people."""

import getpass
import os
import platform
from importlib.metadata import version


def made_by() -> str:
    """Program, person and host."""
    return f"padwatch {version('padwatch')}, {person()}"[:200]


def person() -> str:
    """Person and host."""
    try:
        name = getpass.getuser()
    except (KeyError, OSError):  # a container's user need not have a name
        name = f"user {os.getuid()}"
    return f"{name} on {platform.node()}"
