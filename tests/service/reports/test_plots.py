"""Plots show what they are given; a configuration has a version and keeps its secrets."""

import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from service.reports.plots import BOTTOM, LEFT, RIGHT, TOP, Plot, Scale, TimeScale, around
from service.settings.configuration import configuration_of
from service.settings.plant import load_plant_file


def plot(x_label: str = "Time, UTC", **changes: object) -> Plot:
    arguments: dict[str, object] = {
        "width": 200.0 + LEFT + RIGHT,
        "height": 100.0 + TOP + BOTTOM,
        "x": Scale(0.0, 10.0),
        "y": Scale(0.0, 2e9, divisor=1e9),
        "x_label": x_label,
        "y_label": "Stiffness, GN/m",
        "title": "A plot",
        "name": "one",
    }
    return Plot(**{**arguments, **changes})  # type: ignore[arg-type]


def test_points_are_where_their_values_are_and_error_bars_as_long_as_the_error():
    drawn = plot()
    drawn.points([0.0, 10.0, None], [0.0, 2e9, 1e9], "today")
    drawn.points([5.0], [1e9], "today", errors=[0.5e9])

    circles = re.findall(r'cx="([\d.]+)" cy="([\d.]+)"', drawn.svg())
    places = [(LEFT, TOP + 100.0), (LEFT + 200.0, TOP), (LEFT + 100.0, TOP + 50.0)]
    assert [(float(x), float(y)) for x, y in circles] == places
    assert f'd="M{LEFT + 100.0:.1f} {TOP + 75.0:.1f}V{TOP + 25.0:.1f}"' in drawn.svg()


def test_a_line_breaks_where_nothing_was_measured():
    drawn = plot()
    drawn.line([0.0, 1.0, 2.0, 9.0, 10.0], [1e9, None, 1e9, 1e9, 1e9], "shaft", 2.0)

    [path] = re.findall(r'class="shaft" d="([^"]+)"', drawn.svg())
    assert path.count("M") == 3
    assert path.count("L") == 1


def test_axes_carry_their_units_and_round_ticks():
    words = "".join(ElementTree.fromstring(plot().svg()).itertext())  # noqa: S314  our own

    assert "Stiffness, GN/m" in words
    assert "Time, UTC" in words
    assert [text for _, text in Scale(0.3e9, 0.7e9, divisor=1e9).ticks(5)] == [
        *("0.3", "0.4", "0.5", "0.6", "0.7")
    ]
    assert [text for _, text in Scale(0.02, 50.0, is_log=True).ticks()] == ["0.1", "1", "10"]
    day = 86_400.0
    assert [text for _, text in TimeScale(0.0, 3 * day).ticks(4)] == [
        *("01 Jan", "02 Jan", "03 Jan", "04 Jan")
    ]


@pytest.mark.parametrize("hostile", ["</text><script>alert(1)</script>", '"><svg onload=x>'])
def test_words_on_axes_are_words(hostile):
    drawn = plot(x_label=hostile, title=hostile)
    drawn.upright(5.0, "at", hostile)

    svg = ElementTree.fromstring(drawn.svg())  # noqa: S314  our own
    assert {element.tag.rpartition("}")[2] for element in svg.iter()} <= {
        *("svg", "g", "path", "text", "circle", "clipPath", "rect")
    }
    assert hostile in "".join(svg.itertext())


def test_values_that_are_all_alike_still_have_an_axis():
    low, high = around([5.0, 5.0, None, math.nan]) or (0.0, 0.0)
    assert low < 5.0 < high
    assert around([None, math.nan]) is None
    assert Scale(*(around([0.0]) or (0.0, 0.0))).ticks()


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


def test_a_configuration_holds_no_secret(load):
    text = configuration_of(load(), "0.1.0", None).text.decode()

    assert "SECRET" not in text.upper().replace('"SECRET":', "")
    assert "HIDDEN" not in text
    hook, mail = json.loads(text)["settings"]["delivery"]["receiver"]
    assert hook["url"].startswith("https://alarms.example/")
    assert mail["host"] == "mail.example"


def test_one_setting_more_or_less_is_another_version(load):
    one = configuration_of(load(), "0.1.0", None)

    assert configuration_of(load(), "0.1.0", None).version == one.version
    assert len(one.version) == 64
    others = [
        configuration_of(load("rated_speed_rpm = 92.3", "rated_speed_rpm = 92.4"), "0.1.0", None),
        configuration_of(load(), "0.1.1", None),
        configuration_of(load(), "0.1.0", "c0ffee"),
    ]
    assert len({one.version, *(other.version for other in others)}) == 4
