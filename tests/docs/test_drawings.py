"""Drawings in the documentation: as the script draws them, with the signs of the program."""

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

from core.machine.channel import Channel, Measurand, displacement_factor

DOCS = Path(__file__).parents[2] / "docs"
spec = importlib.util.spec_from_file_location("drawings", DOCS / "_tools" / "drawings.py")
assert spec is not None
assert spec.loader is not None
drawings = importlib.util.module_from_spec(spec)
spec.loader.exec_module(drawings)


@pytest.mark.parametrize("name", ["machine", "signs"])
def test_a_drawing_is_the_one_that_the_script_draws_and_a_page_shows_it(name):
    assert (DOCS / "pictures" / f"{name}.svg").read_text() == drawings.drawings()[name]
    pages = [page.read_text() for page in DOCS.rglob("*.md")]
    assert any(f"pictures/{name}.svg" in text for text in pages)


def test_a_smaller_gap_is_drawn_as_a_shaft_nearer_to_the_probe():
    x_um, y_um, ratio, angle_deg = drawings.shaft_position()
    smaller = drawings.REFERENCE_UM - np.array(drawings.GAPS_UM)
    assert (x_um, y_um) == pytest.approx(tuple(smaller))
    assert ratio == pytest.approx(math.hypot(*smaller) / drawings.CLEARANCE_UM)
    assert angle_deg == pytest.approx(math.degrees(math.atan2(*smaller[::-1])))
    sign = drawings.default_sign(drawings.Transducer.PROXIMITY_PROBE)
    probe = Channel("p", Measurand.GAP_UM, direction=sign)
    [moved] = displacement_factor(probe, np.array([10.0]))
    assert moved.real * (drawings.GAPS_UM[0] - drawings.REFERENCE_UM) > 0.0
    assert f"direction = {sign}".replace("-", "−") in drawings.drawings()["signs"]
