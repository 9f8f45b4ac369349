"""Serving process as a child of the measuring process, joined to it by a socket pair."""

import socket
import subprocess
import sys
from dataclasses import dataclass


@dataclass(frozen=True)
class Child:
    """Running child process, and this end of the socket pair.

    The owner must call `close`; a child notices a closed connection, and ends.
    """

    process: subprocess.Popen[bytes]
    connection: socket.socket

    def close(self) -> None:
        """Close the connection, and kill the child if it has not ended."""
        self.connection.close()
        self.process.kill()
        self.process.wait()


PROGRAM = "service.app.serving_process"
"""Module that the child runs."""


def start_child() -> Child:
    """Start the child and return it; its argument is the descriptor of its end of a socket pair.

    The child has a session of its own: Ctrl-C in a terminal stops this process, which stops it.
    The child must end when this process closes its end.
    """
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(  # noqa: S603  this program itself
            [sys.executable, "-m", PROGRAM, str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            start_new_session=True,
        )
    return Child(process, ours)
