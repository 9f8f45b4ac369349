"""The composition of all processes, as far as it can be judged without a container engine."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from service.cli.commands import app
from service.cluster.ownership import Partition
from service.settings.plant import load_plant_file

FOLDER = Path(__file__).parents[2] / "deploy" / "cluster"
PLANT = FOLDER / "plant-cluster.toml"


def composition(folder: Path = FOLDER) -> Any:
    return yaml.safe_load((folder / "compose.yaml").read_text(encoding="utf-8"))


SERVICES = composition()["services"]
ALONE = composition(FOLDER.with_name("container"))["services"]["padwatch"]
PADWATCH = {name: one for name, one in SERVICES.items() if one["image"] == "padwatch"}


@pytest.mark.parametrize("one", [*SERVICES.values(), ALONE], ids=[*SERVICES, "alone"])
def test_a_container_may_do_little(one):
    assert re.fullmatch(r"[1-9]\d{2,}:[1-9]\d{2,}", one["user"])
    assert one["read_only"] is True
    assert one["cap_drop"] == ["ALL"]
    assert one["security_opt"] == ["no-new-privileges:true"]
    assert "ports" not in one
    assert "privileged" not in one


@pytest.mark.parametrize("name", SERVICES)
def test_a_container_among_others_is_limited_and_only_one_reaches_anything_outside(name):
    outside = ["devices"] if name == "acquire" else []  # which reads devices

    assert SERVICES[name]["mem_limit"]
    assert SERVICES[name]["pids_limit"]
    assert SERVICES[name]["healthcheck"]["test"][0] == "CMD"
    assert SERVICES[name]["networks"] == ["inside", *outside]
    assert composition()["networks"]["inside"] == {"internal": True}


def test_a_container_alone_writes_temporary_files_only_to_memory():
    assert [mount.split(":")[0] for mount in ALONE["tmpfs"]] == ["/tmp"]  # noqa: S108  in the container


def test_secrets_are_files():
    whole = composition()
    named = {secret for one in SERVICES.values() for secret in one.get("secrets", [])}

    assert named == set(whole["secrets"])
    assert all(secret["file"].startswith("./secrets/") for secret in whole["secrets"].values())
    for one in SERVICES.values():
        for key in one.get("environment", {}):
            assert "PASSWORD" not in key or key.endswith("_FILE")


@pytest.mark.parametrize("name", PADWATCH)
def test_a_container_runs_a_command_that_there_is(name):
    command, plant_file, *options = PADWATCH[name]["command"]
    helped = CliRunner().invoke(app, [command, "--help"])

    assert helped.exit_code == 0
    assert all(option in helped.output for option in options if option.startswith("--"))
    assert any(volume.endswith(f"{plant_file}:ro") for volume in PADWATCH[name]["volumes"])
    compile(PADWATCH[name]["healthcheck"]["test"][-1], name, "exec")  # its health, in Python


def test_all_units_are_analysed_by_one_share_each():
    shares = [Partition.of(PADWATCH[name]["command"][-1]) for name in PADWATCH if "analyse" in name]
    units = [f"U{number}" for number in range(1, 8)]

    assert sorted(unit for share in shares for unit in share.units(units)) == units


def test_the_plant_file_names_what_the_composition_has():
    plant = load_plant_file(PLANT)

    assert plant.stream is not None
    assert [url.split("/")[-1] for url in plant.stream.servers] == [
        f"nats{number}:4222" for number in (1, 2, 3)
    ]
    assert {"nats1", "nats2", "nats3", "postgresql"} <= set(SERVICES)
    assert plant.stream.replicas == 3
    assert plant.store.postgresql is not None
    assert "host=postgresql " in plant.store.postgresql
    for path in (plant.stream.token_file, plant.store.password_file):
        assert path is not None
        assert path.removeprefix("/run/secrets/") in composition()["secrets"]
    assert f":{plant.stream.acquire_port}/readyz" in PADWATCH["acquire"]["healthcheck"]["test"][-1]
    assert f":{plant.stream.analyse_port}/readyz" in PADWATCH["analyse1"]["healthcheck"]["test"][-1]
    assert f"'{plant.service.socket}'" in PADWATCH["serve1"]["healthcheck"]["test"][-1]


def test_a_block_that_is_acknowledged_is_on_the_disk():
    text = (FOLDER / "nats.conf").read_text(encoding="utf-8")

    assert re.search(r"^  sync_interval: always$", text, re.M)
    assert all(f"nats://{name}:6222" in text for name in ("nats1", "nats2", "nats3"))


def test_nats_understands_its_file(tmp_path):
    own = Path(sys.executable).with_name("nats-server")
    server = str(own) if own.exists() else shutil.which("nats-server")
    if server is None:
        pytest.skip("needs nats-server")
    shutil.copy(FOLDER / "nats.conf", tmp_path)
    (tmp_path / "nats-token.conf").write_text('authorization { token: "word" }\n')
    command = shlex.join([server, "-t", "-c", str(tmp_path / "nats.conf")])
    done = subprocess.run(shlex.split(command), capture_output=True, text=True, check=False)

    assert "is valid" in done.stderr + done.stdout, done.stderr
