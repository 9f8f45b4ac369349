"""A plant without a DAQ, so that it has an alarm, with an account of each role and a recording."""

import shutil
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from real_plant import RECORDED, Plant

RECORDING = Path(__file__).parents[2] / "recordings" / "part_load"

RECEIVER = """
[[delivery.receiver]]
kind = "webhook"
id = "desk"
url = "http://127.0.0.1:{port}/"
max_retry_s = 1.0
"""


@pytest.fixture(scope="session")
def receiver_port() -> Iterator[int]:
    """Port of an alarm receiver that refuses connections; it stays reserved."""
    with socket.socket() as held:
        held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        held.bind(("127.0.0.1", 0))
        yield held.getsockname()[1]


@pytest.fixture(scope="package")
def plant(
    chromium,  # noqa: ARG001 - skip before start
    tmp_path_factory,
    receiver_port,
) -> Iterator[Plant]:
    folder = tmp_path_factory.mktemp("guarded")
    shutil.copytree(RECORDING, folder / "var" / "demo" / "captures" / RECORDED)
    with Plant(folder) as running:
        running.settings += RECEIVER.format(port=receiver_port)
        running.add_accounts()
        running.start_service()
        yield running
