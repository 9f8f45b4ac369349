"""How a process is called in the database: another name after each start."""

import os
import socket
from uuid import uuid4


def process_name() -> str:
    """Host, number and a word that no other start has had."""
    return f"{socket.gethostname()}:{os.getpid()}:{uuid4().hex[:12]}"
