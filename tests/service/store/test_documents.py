import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from core.baseline.baseline import BearingBaseline, Origin
from core.baseline.history import StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.shaft_response import ShaftResponse
from service.store.documents import baseline_from_json, response_from_json, to_json


@pytest.fixture(scope="module")
def baseline(film_life: Callable[..., StiffnessHistory]) -> BearingBaseline:
    history = film_life(4, days=60)
    origin = Origin("U1", "LJB", "transfer_order1", 3, "Ada", 1_700_000_000_123_456_789, "overhaul")
    settled = np.ones(len(history), np.bool_)
    return learn(history, settled, origin, BaselineSettings())


def test_a_baseline_comes_back_as_it_was(baseline: BearingBaseline) -> None:
    assert baseline_from_json(to_json(baseline)) == baseline


def test_a_response_comes_back_as_it_was_unless_it_was_tampered_with() -> None:
    response = ShaftResponse((("UJB", "x"),), (20.0,), ((0.1, 0.2, 0.3),), (0.01,))
    assert response_from_json(to_json(response)) == response
    with pytest.raises(ValueError, match="std"):
        response_from_json(to_json(response).replace('"std": [', '"std": [-1.0, ', 1))


def change(content: Any, path: list[str | int], value: object) -> None:
    for step in path[:-1]:
        content = content[step]
    if value is KeyError:
        del content[path[-1]]
    else:
        content[path[-1]] = value


FIRST = ["content", "quantities", 0]


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        (["format"], "spectrum", "format: .* 'padwatch-baseline'"),
        (["format_version"], 2, "format_version: .* 1 "),
        (["content", "origin", "author"], KeyError, "content.origin.author: Field required"),
        (["content", "origin", "auther"], "Ada", "content.origin.auther: Unexpected"),
        (["content", "origin", "version"], "3", "content.origin.version: .* '3'"),
        (["content", "origin", "version"], True, "content.origin.version: .* True"),
        ([*FIRST, "direction"], "z", "quantities.0: direction must be"),
        ([*FIRST, "quantity"], "colour", "quantities.0.quantity: .* 'colour'"),
        ([*FIRST, "scatter"], -1.0, "quantities.0: scatter and reading_h must be"),
        ([*FIRST, "surface", "coefficients"], [1.0], "coefficients, got 1"),
        ([*FIRST, "surface", "coefficients", 0], None, "coefficients.0: .* None"),
        ([*FIRST, "surface", "shape", "temperature", "width"], 0.0, "temperature: width = 0"),
        ([*FIRST, "grid", "eccentricity_width"], -0.05, "grid: eccentricity_width = -0.05"),
        ([*FIRST, "table", "cells", 0, "support"], "some", "cells.0.support: .* 'some'"),
        ([*FIRST, "table", "cells", 0, "cell"], [99, 99, 99], "all have the same number of axes"),
        ([*FIRST, "time_scatter", 0, "time_scale_h"], 1e9, "must increase"),
    ],
)
def test_a_baseline_that_was_tampered_with_is_refused(
    baseline: BearingBaseline, path: list[str | int], value: object, says: str
) -> None:
    content = json.loads(to_json(baseline))
    change(content, path, value)
    with pytest.raises(ValueError, match=says):
        baseline_from_json(json.dumps(content))


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{", "null", '{"format": 1, "format": 2}', '{"a": NaN}', "[" * 100_000],
)
def test_what_is_no_baseline_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        baseline_from_json(text)


def test_a_huge_number_is_refused(baseline: BearingBaseline) -> None:
    text = to_json(baseline).replace('"scatter": ', '"scatter": 1e999, "x": ', 1)
    with pytest.raises(ValueError, match=r".+"):
        baseline_from_json(text)
