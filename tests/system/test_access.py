"""The program with logins: over TLS, over a unix socket, and its first account."""

import asyncio
import re
import ssl
import subprocess
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx2
import pytest

Start = Callable[..., Awaitable[Any]]
Write = Callable[[str], Path]

PASSWORD = "the river is high in may"  # noqa: S105
TOKEN = re.compile(r"^padwatch: to make the first account.*: (\S{43})$", re.MULTILINE)


@pytest.fixture
def plant_with(tmp_path: Path, demo_file: Path) -> Write:
    """The demo plant with other settings of its service; its DAQ is not there."""

    def write(settings: str) -> Path:
        demo = demo_file.read_text(encoding="utf-8").replace("var/demo", str(tmp_path))
        path = tmp_path / "plant.toml"
        path.write_text(demo.replace("port = 0", "port = 1"), encoding="utf-8")
        head, *rest = path.read_text(encoding="utf-8").partition("[service]\n")
        path.write_text(head + rest[0] + settings + rest[1], encoding="utf-8")
        return path

    return write


@pytest.fixture(scope="session")
def certificate(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A certificate for 127.0.0.1 and its key."""
    folder = tmp_path_factory.mktemp("tls")
    files = folder / "padwatch.crt", folder / "padwatch.key"
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"]
    names = ["-subj", "/CN=padwatch", "-addext", "subjectAltName=IP:127.0.0.1", "-days", "2"]
    out = ["-nodes", "-out", str(files[0]), "-keyout", str(files[1])]
    subprocess.run([*command, *names, *out], check=True, capture_output=True)
    return files


async def test_the_first_account_is_made_with_what_the_service_prints(
    start: Start, plant_with: Write
) -> None:
    plant = plant_with("")
    plant.write_text(plant.read_text(encoding="utf-8") + "\n[access]\nlogin = true\n")
    service = await start("run", str(plant), "--port", "0")
    url = await service.wait_for_url()
    [token] = TOKEN.findall("".join(service.said))
    async with httpx2.AsyncClient(base_url=url, trust_env=False) as client:
        closed = await client.get("/api/v1/units")
        body = {"token": token, "name": "anna", "password": PASSWORD}
        made = await client.post("/api/v1/set-up", json=body)
        login = await client.post("/api/v1/session", json={"name": "anna", "password": PASSWORD})
        cookie = login.headers["set-cookie"].partition(";")[0]
        seen = await client.get("/api/v1/units", headers={"Cookie": cookie})
        open_ = await client.get("/readyz")

    assert [r.status_code for r in (closed, made, login, seen)] == [401, 201, 201, 200]
    assert open_.status_code in (200, 503)
    assert await service.end() == 0
    assert token not in service.errors


async def test_over_tls_the_service_shows_its_certificate(
    start: Start, plant_with: Write, certificate: tuple[Path, Path]
) -> None:
    service = await start("run", str(with_tls(plant_with(""), certificate)), "--port", "0")
    url = await said_url(service)
    trusted = ssl.create_default_context(cafile=certificate[0])
    async with httpx2.AsyncClient(base_url=url, verify=trusted, trust_env=False) as client:
        answer = await client.get("/livez")
        plain = httpx2.AsyncClient(base_url=url.replace("https", "http"), trust_env=False)
        with pytest.raises(httpx2.TransportError):
            await plain.get("/livez")

    assert url.startswith("https://127.0.0.1:")
    assert answer.status_code == 200
    assert answer.headers["strict-transport-security"]
    assert await service.end() == 0


async def test_on_a_socket_everybody_logs_in_and_the_proxy_says_who_it_speaks_for(
    start: Start, plant_with: Write, tmp_path: Path
) -> None:
    path = tmp_path / "http.sock"
    service = await start("run", str(plant_with(f'socket = "{path}"\n')))
    assert await said_url(service) == f"unix:{path}"
    assert path.stat().st_mode & 0o777 == 0o660
    [token] = TOKEN.findall("".join(service.said))
    transport = httpx2.AsyncHTTPTransport(uds=str(path))
    headers = {"X-Forwarded-For": "127.0.0.1, 192.0.2.7", "X-Forwarded-Proto": "https"}
    async with httpx2.AsyncClient(
        transport=transport, base_url="http://localhost", headers=headers
    ) as client:
        closed = await client.get("/api/v1/units")
        body = {"token": token, "name": "anna", "password": PASSWORD}
        made = await client.post("/api/v1/set-up", json=body)
        own = {"Origin": "https://localhost"}
        body = {"name": "anna", "password": PASSWORD}
        login = await client.post("/api/v1/session", json=body, headers=own)
        cookie = login.headers["set-cookie"].partition(";")[0]
        told = (await client.get("/api/v1/audit", headers={"Cookie": cookie})).json()

    assert [r.status_code for r in (closed, made, login)] == [401, 201, 201]
    assert told["entries"][0]["peer"] == "192.0.2.7"
    assert await service.end() == 0
    assert not path.exists()


@pytest.mark.parametrize("has_tls", [False, True])
async def test_for_others_nothing_starts_without_tls_and_an_account(
    start: Start, plant_with: Write, certificate: tuple[Path, Path], has_tls: bool
) -> None:
    plant = with_tls(plant_with(""), certificate) if has_tls else plant_with("")
    text = plant.read_text(encoding="utf-8").replace('"127.0.0.1"', '"0.0.0.0"', 1)
    plant.write_text(text, encoding="utf-8")
    service = await start("run", str(plant), "--port", "0")

    assert await service.process.wait() != 0
    await service._reading
    assert ("an account" if has_tls else "[service.tls]") in service.errors
    assert "Traceback" not in service.errors


def with_tls(plant: Path, files: tuple[Path, Path]) -> Path:
    """The same plant file with a certificate for its server."""
    table = f'\n[service.tls]\ncertificate = "{files[0]}"\nkey = "{files[1]}"\n'
    plant.write_text(plant.read_text(encoding="utf-8") + table, encoding="utf-8")
    return plant


async def said_url(service: Any) -> str:
    """The last line that it prints before it serves."""
    async with asyncio.timeout(90.0):
        while line := (await service.process.stdout.readline()).decode():
            service.said.append(line)
            if line.startswith(("padwatch: https://", "padwatch: unix:")):
                return str(line.removeprefix("padwatch: ").strip().rstrip("/"))
    raise AssertionError(f"ended without a URL: {service.said} {service.errors}")
