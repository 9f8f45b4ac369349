"""Late answers are given up, the server stops whatever its clients do; TLS and socket files."""

import asyncio
import os
import socket
import ssl
import stat
import subprocess
from typing import Any

import pytest

from service.api.server import TrustedProxy
from service.runtime.listening import CertificateError, PortInUseError, server_tls, socket_file


async def test_an_answer_that_does_not_come_is_given_up(start, caplog):
    running = await start(answer_s=1.0)
    client = await running.ask("/slow")
    await running.until(lambda: running.app.asker is not None)
    assert not running.app.asker.has_gone

    assert await client.status() == 503
    assert b"timed out" in client.body
    assert b"retry-after: 5" in client.head
    assert running.app.asker.has_gone  # and so is what threads still read
    assert not caplog.records


async def test_a_body_that_never_ends_is_given_up(start):
    running = await start(answer_s=1.0)
    client = await running.ask("/", "POST", "Content-Length: 10\r\n")
    await client.send(b"12345")

    assert await client.status() == 503


async def test_an_answer_that_is_read_slowly_arrives(start):
    running = await start(answer_s=1.0)
    client = await running.ask("/large")
    await client.reader.readuntil(b"\r\n\r\n")
    await asyncio.sleep(1.2)

    assert len(await client.reader.readexactly(64 * 1024 * 1024)) == 64 * 1024 * 1024


async def test_a_good_client_is_served_beside_five_hundred_that_never_finish(running):
    for head in (b"", b"GET / HTTP/1.1\r\nHo") * 250:
        await (await running.client()).send(head)

    for _ in range(20):
        client = await running.ask()
        assert await client.status() == 200


async def test_too_many_connections_are_refused(start):
    running = await start(max_connections=2)
    slow = await running.ask("/slow")
    await running.until(lambda: running.app.n_asked == 1)

    late = await running.ask()

    assert await late.status() == 503
    running.app.goes_on.set()
    assert await slow.status() == 200


@pytest.mark.parametrize("what", ["silent", "head", "body", "unread", "unanswered"])
async def test_the_server_stops_whatever_clients_do(running, what, caplog):
    client = await running.client()
    said = {
        "silent": b"",
        "head": b"GET / HTTP/1.1\r\nHo",
        "body": b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 9\r\n\r\n1",
        "unread": b"GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n",
        "unanswered": b"GET /slow HTTP/1.1\r\nHost: localhost\r\n\r\n",
    }[what]
    await client.send(said)
    if what in ("unread", "unanswered"):
        await running.until(lambda: running.app.n_asked == 1)

    running.server.should_exit = True
    await running.serving

    assert not any(record.exc_info for record in caplog.records)
    if what == "unanswered":
        assert await client.status() == 503
        assert b"is stopping" in client.body


@pytest.mark.parametrize("said", [b"", b"\x16\x03\x01\x02\x00", b"GET / HTTP/1.1\r\n\r\n"])
async def test_a_tls_handshake_that_never_ends_keeps_nobody_out(start, certificate, said):
    running = await start(server_tls(*certificate))
    await (await running.client()).send(said)
    good = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    good.check_hostname, good.verify_mode = False, ssl.CERT_NONE

    asking, answer = await asyncio.open_connection("127.0.0.1", running.port, ssl=good)
    answer.write(b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")

    assert b"200" in await asking.readline()
    answer.close()


def test_nothing_older_than_tls_1_2_is_spoken(certificate):
    assert server_tls(*certificate).minimum_version is ssl.TLSVersion.TLSv1_2


def test_a_certificate_that_cannot_be_used_is_refused_in_one_line(certificate, tmp_path):
    public, key = certificate
    locked = tmp_path / "locked.key"
    lock = ["openssl", "ec", "-in", str(key), "-aes128", "-passout", "pass:secret"]
    subprocess.run([*lock, "-out", str(locked)], check=True, capture_output=True)
    for wrong in (
        (tmp_path / "none.crt", key),
        (public, tmp_path),
        (key, public),
        (public, public),
        (public, locked),
    ):
        with pytest.raises(CertificateError, match=r"^service\.tls: .+") as refused:
            server_tls(*wrong)
        assert "\n" not in str(refused.value)


def test_a_socket_file_is_for_user_and_group_and_goes_at_the_end(tmp_path):
    path = tmp_path / "http.sock"
    with socket.socket(socket.AF_UNIX) as left:  # by a service that was killed
        left.bind(str(path))
    with socket_file(path), socket.socket(socket.AF_UNIX) as client:
        client.connect(str(path))
        mode = path.stat().st_mode
        assert stat.S_ISSOCK(mode)
        assert stat.S_IMODE(mode) == 0o660

    assert not path.exists()


def test_nothing_else_is_ever_removed_for_a_socket(tmp_path):
    path = tmp_path / "notes.txt"
    path.write_text("keep")
    with pytest.raises(PortInUseError, match="another file is there"), socket_file(path):
        pass
    running = tmp_path / "http.sock"
    with socket_file(running):
        with (
            pytest.raises(PortInUseError, match="another program listens on it"),
            socket_file(running),
        ):
            pass
        assert running.exists()
    with (
        pytest.raises(PortInUseError, match="cannot listen"),
        socket_file(tmp_path / "no" / "where.sock"),
    ):
        pass

    assert path.read_text() == "keep"
    assert os.listdir(tmp_path) == ["notes.txt"]


@pytest.mark.parametrize(
    ("headers", "client", "scheme"),
    [
        ({}, None, "http"),
        ({"x-forwarded-for": "192.0.2.7", "x-forwarded-proto": "https"}, "192.0.2.7", "https"),
        ({"x-forwarded-for": "127.0.0.1, 192.0.2.7"}, "192.0.2.7", "http"),
        ({"x-forwarded-for": "2001:db8::7", "x-forwarded-proto": "wss"}, "2001:db8::7", "http"),
        ({"x-forwarded-for": "<script>"}, None, "http"),
    ],
)
async def test_a_proxy_on_the_socket_says_whom_it_speaks_for(headers, client, scheme):
    seen: dict[str, Any] = {}

    async def app(scope: Any, receive: Any, send: Any) -> None:  # noqa: ARG001
        seen.update(scope)

    pairs = [(name.encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "http", "headers": pairs, "client": None, "scheme": "http"}
    await TrustedProxy(app)(scope, None, None)  # type: ignore[arg-type]

    assert seen["client"] == (None if client is None else (client, 0))
    assert seen["scheme"] == scheme
