"""A symbolic link under which a pseudo-terminal is found, whatever the system calls it."""

import os
from pathlib import Path

from acquisition.errors import ConfigError, LinkError

_TERMINALS = "/dev/pts/"


def point(link: Path, terminal: str) -> None:
    """Let a link point to a terminal, in the place of one that does, or did.

    Raises
    ------
    ConfigError
        If something else is there, as the port of a real device; it is left alone.
    LinkError
        If the link cannot be made.
    """
    try:
        if os.path.lexists(link) and not _is_ours(link):
            raise ConfigError(
                f"{link}: something else is there; a simulated DAQ makes a link of its own, which"
                ' needs a free name such as "/tmp/line7", or "pty" for none'
            )
        remove(link)
        link.symlink_to(terminal)
    except OSError as exc:
        raise LinkError(f"{link}: cannot be made: {exc.strerror}") from exc


def remove(link: Path) -> None:
    """Take a link away, if it points to a terminal."""
    if _is_ours(link):
        link.unlink(missing_ok=True)


def _is_ours(link: Path) -> bool:
    return link.is_symlink() and str(link.readlink()).startswith(_TERMINALS)
