"""Who made a file, for people."""

import getpass
import os
import platform
from importlib.metadata import version


def made_by() -> str:
    """Program, person and host."""
    try:
        person = getpass.getuser()
    except (KeyError, OSError):  # a container's user need not have a name
        person = f"user {os.getuid()}"
    return f"padwatch {version('padwatch')}, {person} on {platform.node()}"[:200]
