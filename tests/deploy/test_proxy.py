"""The shipped nginx configuration, with a real nginx before a real server on a socket file."""

import asyncio
import json
import re
import shutil
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from rigs.command_line import free_port
from starlette.requests import Request
from starlette.responses import JSONResponse
from starlette.types import Receive, Scope, Send

from service.api.server import TrustedProxy, http_server
from service.runtime.listening import socket_file
from service.settings.processes import HttpLimitSettings

SHIPPED = Path(__file__).parents[2] / "deploy" / "proxy" / "nginx.conf"

MAIN = """
user root;
daemon off;
pid {folder}/nginx.pid;
error_log {folder}/error.log;
events {{}}
http {{
  access_log off;
  client_body_temp_path {folder}/body;
  proxy_temp_path {folder}/proxy;
  fastcgi_temp_path {folder}/fastcgi;
  uwsgi_temp_path {folder}/uwsgi;
  scgi_temp_path {folder}/scgi;
  include {folder}/padwatch.conf;
}}
"""

PATIENCE_S = 120.0


def configured(folder: Path, certificate: tuple[Path, Path], port: int) -> Path:
    """Write the shipped configuration, with names, files and ports of a test."""
    public, key = certificate
    text = SHIPPED.read_text(encoding="utf-8")
    for shipped, own in (
        ("unix:/run/padwatch/http.sock", f"unix:{folder}/http.sock"),
        ("/etc/nginx/padwatch.crt", str(public)),
        ("/etc/nginx/padwatch.key", str(key)),
        ("listen 80;", f"listen unix:{folder}/plain.sock;"),
        (
            "listen 443 ssl http2;",
            f"listen 127.0.0.1:{port}; listen unix:{folder}/tls.sock ssl http2;",
        ),
        ("client_header_timeout 5s;", "client_header_timeout 1s;"),
    ):
        assert text.count(shipped) == 1, shipped
        text = text.replace(shipped, own)
    (folder / "padwatch.conf").write_text(text, encoding="utf-8")
    main = folder / "nginx.conf"
    main.write_text(MAIN.format(folder=folder), encoding="utf-8")
    return main


async def app(scope: Scope, receive: Receive, send: Send) -> None:
    """Answer with what is seen of a request."""
    request = Request(scope)
    client = request.client.host if request.client else None
    await JSONResponse({"client": client, "host": request.headers["host"]})(scope, receive, send)


@asynccontextmanager
async def proxied(folder: Path, certificate: tuple[Path, Path]) -> AsyncIterator[int]:
    """Run a server on a socket file behind nginx; the port of nginx."""
    nginx = shutil.which("nginx", path="/usr/sbin:/usr/bin:/bin") or pytest.skip("needs nginx")
    port = free_port()
    main = configured(folder, certificate, port)
    subprocess.run([nginx, "-t", "-c", str(main)], check=True, capture_output=True)
    with socket_file(folder / "http.sock") as listener:
        server = http_server(TrustedProxy(app), HttpLimitSettings(), ["padwatch.example"])
        serving = asyncio.create_task(server.run_on(listener))
        proxy = await asyncio.create_subprocess_exec(nginx, "-c", str(main))
        try:
            async with asyncio.timeout(PATIENCE_S):
                while not (folder / "nginx.pid").read_text():  # the check leaves an empty one
                    await asyncio.sleep(0.01)
                yield port
        finally:
            proxy.terminate()
            await proxy.wait()
            server.should_exit = True
            await serving


async def answer(port: int, sent: bytes) -> tuple[int, bytes, bytes]:
    """Status, head and body of the answer to some bytes; status 0 if there is none."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(sent)
    head, _, body = (await reader.read()).partition(b"\r\n\r\n")
    writer.close()
    found = re.match(rb"HTTP/1\.1 (\d+)", head)
    return (int(found[1]) if found else 0), head.lower(), body


GET = b"GET / HTTP/1.1\r\nHost: padwatch.example\r\nConnection: close\r\n"


async def test_the_proxy_passes_on_who_asks_and_refuses_what_is_no_request(tmp_path, certificate):
    async with proxied(tmp_path, certificate) as port:
        status, _, body = await answer(port, GET + b"X-Forwarded-For: 192.0.2.7\r\n\r\n")
        assert status == 200
        assert json.loads(body) == {"client": "127.0.0.1", "host": "padwatch.example"}

        for sent, status in (
            (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", 400),
            (b"GET / HTTP/9.9\r\nHost: padwatch.example\r\n\r\n", 505),
            (GET + b"Host: padwatch.example\r\n\r\n", 400),
            (GET + b"X: " + b"a" * 9_000 + b"\r\n\r\n", 400),
            (GET.replace(b"/ ", b"/" + b"a" * 9_000 + b" ") + b"\r\n", 414),
            (GET + b"Content-Length: 1\r\nContent-Length: 2\r\n\r\n", 400),
            (GET + b"Content-Length: 3\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", 400),
            (GET.replace(b"GET", b"POST") + b"Content-Length: 20000\r\n\r\n", 413),
        ):
            found, head, body = await answer(port, sent)
            assert found == status, sent[:60]
            assert b"content-type: application/problem+json" in head
            problem = json.loads(body)
            assert problem["status"] == status
            assert problem["detail"]
            assert len(body) <= 2048


async def test_the_proxy_closes_a_connection_whose_head_never_ends(tmp_path, certificate):
    async with proxied(tmp_path, certificate) as port:
        for sent in (b"", b"GET / HTTP/1.1\r\nHo"):
            assert (await answer(port, sent))[0] in (0, 408)
