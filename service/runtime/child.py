"""Serving process as a child of the measuring process, joined to it by a socket pair."""

import socket
import subprocess
import sys
from dataclasses import dataclass


@dataclass(frozen=True)
class Child:
    """Child process, and the parent's end of the socket pair that connects both.

    The owner must call `close`; the child ends when the connection is closed.
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
    """Start the serving process as a child that is connected by a socket pair.

    The child has a session of its own: Ctrl-C in a terminal stops this process only, and the
    child ends when this process closes its end of the socket pair.
    """
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(  # noqa: S603  this program itself
            [sys.executable, "-P", "-m", PROGRAM, str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            start_new_session=True,
        )
    return Child(process, ours)
