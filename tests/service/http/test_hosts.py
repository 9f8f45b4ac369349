"""Which names a plant's service answers to."""

import tomllib
from pathlib import Path

import httpx2
from starlette.responses import PlainTextResponse

from acquisition.clock import SystemClock
from service.settings.plant import PlantFile
from service.wiring.http import server_of

DEMO = Path(__file__).parents[3] / "deploy" / "demo.toml"


async def asked(host: str, came_to: str = "127.0.0.1") -> int:
    """Status for a request to an address by a name, of a plant with names of its own."""
    read = tomllib.loads(DEMO.read_text(encoding="utf-8"))
    read.setdefault("service", {})["hosts"] = ["watch.plant.example"]
    read["delivery"] = {"dashboard_url": "https://people.plant.example:8443/"}
    plant = PlantFile.model_validate(read)
    app = server_of(PlainTextResponse("here"), plant, SystemClock()).config.app
    transport = httpx2.ASGITransport(app)
    async with httpx2.AsyncClient(transport=transport, base_url=f"http://{came_to}/") as client:
        return (await client.get("/", headers={"Host": host})).status_code


async def test_a_plant_s_service_answers_to_its_names_and_to_no_other() -> None:
    for host in (
        *("localhost", "127.0.0.1:8080", "[::1]", "LocalHost:1"),
        *("watch.plant.example", "Watch.Plant.Example.:443", "people.plant.example:8443"),
    ):
        assert await asked(host) == 200, host
    for host in ("plant.example", "evil.example", "x.localhost", "[]", ":80"):
        assert await asked(host) == 421, host
    for host in ("127.0.0.1:8231@evil", "127.0.0.1:abc", "localhost:123456", "[::1]evil"):
        assert await asked(host) == 421, host


async def test_the_address_a_client_came_to_is_a_name_too() -> None:
    assert await asked("10.0.0.7:8080", came_to="10.0.0.7") == 200
    assert await asked("10.0.0.7") == 421
