"""A gateway that takes a connection only to close it: its one place is another master's."""

import socket
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest

from acquisition.errors import LinkError
from acquisition.modbus.identity import ExpectedIdentification
from acquisition.modbus.link import ModbusLink
from acquisition.modbus.transport import LinkSettings, TcpTransport

N_TRIES = 200


@pytest.fixture
def port() -> Iterator[int]:
    """In a thread of its own: closed before the client has written anything."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def hang_up() -> None:
            with suppress(OSError):
                while True:
                    server.accept()[0].close()

        thread = threading.Thread(target=hang_up)
        thread.start()
        yield server.getsockname()[1]
        server.shutdown(socket.SHUT_RDWR)
        thread.join()


async def test_it_is_a_lost_link_each_time_and_nothing_else(port: int) -> None:
    settings = LinkSettings(
        transport=TcpTransport(host="127.0.0.1", port=port),
        identity=ExpectedIdentification(vendor="any"),
    )
    for _ in range(N_TRIES):
        link = ModbusLink(settings)
        with pytest.raises(LinkError, match=r"closed the connection|reset by peer"):
            await link.open()
        link.close()
