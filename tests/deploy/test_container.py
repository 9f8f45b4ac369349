"""The container files, as far as they can be judged without a container engine."""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from fnmatch import fnmatch
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
import yaml

from service.settings.plant import load_plant_file

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "deploy" / "container"

Step = tuple[str, str]


def steps() -> list[Step]:
    """Instructions of the container file, each with its arguments on one line."""
    text = re.sub(r"^#.*\n", "", (FOLDER / "Containerfile").read_text(encoding="utf-8"), flags=re.M)
    lines = re.sub(r"\\\n\s*", " ", text).splitlines()
    return [(word, rest) for word, _, rest in (line.partition(" ") for line in lines if line)]


def last(word: str) -> str:
    """The last instruction of a kind, in the last stage."""
    found = steps()
    stage = max(n for n, (name, _) in enumerate(found) if name == "FROM")
    return [rest for name, rest in found[stage:] if name == word][-1]


def health_command() -> list[str]:
    command: list[str] = json.loads(last("HEALTHCHECK").partition(" CMD ")[2])
    return command


def compose() -> Any:
    return yaml.safe_load((FOLDER / "compose.yaml").read_text(encoding="utf-8"))


def test_every_instruction_is_one_that_engines_know():
    known = "FROM WORKDIR RUN COPY ENV USER VOLUME STOPSIGNAL HEALTHCHECK ENTRYPOINT CMD"

    assert {name for name, _ in steps()} <= set(known.split())
    assert [rest.split()[0] for name, rest in steps() if name == "FROM"] == [
        "python:3.11-slim-bookworm",
        "python:3.11-slim-bookworm",
    ]


def test_everything_that_is_copied_exists_and_reaches_the_build():
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    allowed = [line.removeprefix("!") for line in ignored if line.startswith("!")]
    copied = [rest.split()[:-1] for name, rest in steps() if name == "COPY"]
    sources = [source for each in copied for source in each if not each[0].startswith("--from")]

    assert len(sources) >= 6
    for source in sources:
        assert (ROOT / source).exists(), source
        assert any(fnmatch(source.split("/")[0], name) for name in allowed), source


def test_third_party_packages_are_pinned_by_their_hashes():
    installs = [rest for name, rest in steps() if name == "RUN" and "-r requirements" in rest]

    assert len(installs) == 2
    assert all("--require-hashes --only-binary :all:" in rest for rest in installs)
    for name in ("run.txt", "build.txt"):
        text = (ROOT / "requirements" / name).read_text(encoding="utf-8")
        pins = re.findall(r"^[a-z0-9-]+==\S+ \\\n    --hash=sha256:", text, flags=re.M | re.I)
        assert len(pins) == len(re.findall(r"^[a-z0-9-]+==", text, flags=re.M | re.I)) > 0


def test_the_container_runs_the_service_as_process_one_and_not_as_root():
    assert re.fullmatch(r"[1-9]\d{3,}:[1-9]\d{3,}", last("USER"))
    assert compose()["services"]["padwatch"]["user"] == last("USER")
    assert json.loads(last("ENTRYPOINT")) == ["padwatch"]
    assert json.loads(last("CMD")) == ["run", "/etc/padwatch/plant.toml"]


class Health(BaseHTTPRequestHandler):
    """Answers `/readyz` as it is told."""

    status = 200

    def do_GET(self) -> None:
        self.send_response(self.status if self.path == "/readyz" else 404)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Say nothing."""


@pytest.fixture
def health() -> Iterator[HTTPServer]:
    with HTTPServer(("127.0.0.1", 0), Health) as server:
        thread = Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.mark.parametrize(("status", "is_healthy"), [(200, True), (503, False), (404, False)])
def test_the_health_check_fails_without_a_ready_service(health, status, is_healthy, monkeypatch):
    monkeypatch.setattr(Health, "status", status)
    python, option, script = health_command()
    assert (python, option) == ("python", "-c")
    assert "127.0.0.1:8080/readyz" in script

    asked = script.replace(":8080", f":{health.server_port}")
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, check=False)

    assert (done.returncode == 0) is is_healthy


def test_the_composed_service_is_reached_from_the_host_only():
    assert compose()["services"]["padwatch"]["network_mode"] == "host"
    plant = load_plant_file(ROOT / "deploy" / "plant.toml")
    assert plant.service.host == "127.0.0.1"
    assert plant.service.port == 8080  # where the health check looks


def test_everything_that_the_composition_names_exists():
    found = compose()
    service = found["services"]["padwatch"]
    context = (FOLDER / service["build"]["context"]).resolve()

    assert context == ROOT
    assert (context / service["build"]["dockerfile"]).is_file()
    data, plant = service["volumes"]
    assert data.split(":")[0] in found["volumes"]
    assert data.split(":")[1] == last("VOLUME") == last("WORKDIR")
    default = re.fullmatch(r"\$\{PADWATCH_PLANT:-(.+)\}:/etc/padwatch/plant.toml:ro", plant)
    assert default is not None
    assert (FOLDER / default[1]).is_file()
