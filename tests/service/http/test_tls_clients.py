"""A client that never finishes its TLS handshake does not stay, nor keep the server."""

import asyncio
import socket
import ssl
from pathlib import Path

import pytest
from rigs.tiers import covering
from starlette.responses import PlainTextResponse

from service.http.config import GuardedConfig
from service.http.server import GuardedServer
from service.http.tls import server_tls
from service.settings.http_limits import HttpLimitSettings

PATIENCE_S = 30.0


@pytest.fixture
def tls(certificate: tuple[Path, Path]) -> ssl.SSLContext:
    return server_tls(*certificate)


SENT = [b"", b"\x16\x03\x01\x02\x00", b"GET / HTTP/1.1\r\n\r\n"]


@pytest.mark.parametrize(("said", "is_stopped"), covering(SENT, [False, True]))
async def test_a_handshake_that_never_ends_is_given_up(
    tls: ssl.SSLContext, said: bytes, is_stopped: bool
) -> None:
    limits = HttpLimitSettings(head_s=60.0 if is_stopped else 0.5)
    app, listener = PlainTextResponse("here"), socket.create_server(("127.0.0.1", 0))
    config = GuardedConfig(app, limits, [], lambda: 0.0, ssl_context_factory=lambda *_: tls)
    server = GuardedServer(config)
    async with asyncio.timeout(PATIENCE_S):
        serving = asyncio.create_task(server.serve([listener]))
        reader, writer = await asyncio.open_connection(*listener.getsockname())
        writer.write(said)
        good = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        good.check_hostname, good.verify_mode = False, ssl.CERT_NONE
        asking, answer = await asyncio.open_connection(*listener.getsockname(), ssl=good)
        answer.write(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        assert b"200" in await asking.readline()
        answer.close()
        if not is_stopped:
            while await reader.read(100):
                pass
        server.should_exit = True
        await serving
        writer.close()
