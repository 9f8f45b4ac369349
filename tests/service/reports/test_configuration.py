"""A configuration has a version that changes with it, and keeps its secrets."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from service.settings.configuration import configuration_of
from service.settings.loading import load_plant_file

RECEIVERS = """
[[delivery.receiver]]
id = "hook"
kind = "webhook"
url = "https://alarms.example:8443/hooks/T0PS3CRET?token=S3CRETT0O"
secret = { env = "HIDDEN_KEY" }
authorization = { file = "/etc/padwatch/HIDDEN_FILE" }

[[delivery.receiver]]
id = "mail"
kind = "smtp"
host = "mail.example"
username = "HIDDEN_USER"
password = { env = "HIDDEN_PASSWORD" }
sender = "padwatch@plant.example"
recipients = ["night@plant.example"]
"""


@pytest.fixture
def load(tmp_path: Path, plant_text: str) -> Callable[..., Any]:
    def loaded(old: str = "", new: str = "") -> Any:
        path = tmp_path / "plant.toml"
        path.write_text(plant_text.replace(old, new, 1) + RECEIVERS, encoding="utf-8")
        return load_plant_file(path)

    return loaded


def test_a_configuration_holds_no_secret(load: Callable[..., Any]) -> None:
    text = configuration_of(load(), "0.1.0", None).text.decode()

    assert "SECRET" not in text.upper().replace('"SECRET":', "")
    assert "HIDDEN" not in text
    hook, mail = json.loads(text)["settings"]["delivery"]["receiver"]
    assert hook["url"].startswith("https://alarms.example/")
    assert mail["host"] == "mail.example"


def test_one_setting_more_or_less_is_another_version(load: Callable[..., Any]) -> None:
    one = configuration_of(load(), "0.1.0", None)

    assert configuration_of(load(), "0.1.0", None).version == one.version
    assert len(one.version) == 64
    others = [
        configuration_of(load("rated_speed_rpm = 92.3", "rated_speed_rpm = 92.4"), "0.1.0", None),
        configuration_of(load(), "0.1.1", None),
        configuration_of(load(), "0.1.0", "c0ffee"),
    ]
    assert len({one.version, *(other.version for other in others)}) == 4
