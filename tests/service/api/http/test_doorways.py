"""Certificates and socket files that the server is given, and what a proxy may say."""

import os
import socket
import ssl
import stat
import subprocess
from pathlib import Path
from typing import Any

import pytest

from service.api.http.listening import CertificateError, PortInUseError, server_tls, socket_file
from service.api.http.middleware import TrustedProxy


def test_nothing_older_than_tls_1_2_is_spoken(certificate: tuple[Path, Path]) -> None:
    assert server_tls(*certificate).minimum_version is ssl.TLSVersion.TLSv1_2


def test_a_certificate_that_cannot_be_used_is_refused_in_one_line(
    certificate: tuple[Path, Path], tmp_path: Path
) -> None:
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


def test_a_socket_file_is_for_user_and_group_and_goes_at_the_end(tmp_path: Path) -> None:
    path = tmp_path / "http.sock"
    with socket.socket(socket.AF_UNIX) as left:  # by a service that was killed
        left.bind(str(path))
    with socket_file(path), socket.socket(socket.AF_UNIX) as client:
        client.connect(str(path))
        mode = path.stat().st_mode
        assert stat.S_ISSOCK(mode)
        assert stat.S_IMODE(mode) == 0o660

    assert not path.exists()


def test_nothing_else_is_ever_removed_for_a_socket(tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("keep")
    with pytest.raises(PortInUseError, match="not a socket"), socket_file(path):
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
async def test_a_proxy_on_the_socket_says_whom_it_speaks_for(
    headers: dict[str, str], client: str | None, scheme: str
) -> None:
    seen: dict[str, Any] = {}

    async def app(scope: Any, receive: Any, send: Any) -> None:  # noqa: ARG001
        seen.update(scope)

    pairs = [(name.encode(), value.encode()) for name, value in headers.items()]
    scope = {"type": "http", "headers": pairs, "client": None, "scheme": "http"}
    await TrustedProxy(app)(scope, None, None)  # type: ignore[arg-type]

    assert seen["client"] == (None if client is None else (client, 0))
    assert seen["scheme"] == scheme
