"""References are kept as they were set; baselines are read as they were or refused."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rigs.assessments import assessment
from rigs.store_fixtures import at

from core.alarms.judgements import OrderVector, VectorReference
from core.baseline.baseline import BearingBaseline, Origin
from core.baseline.history import StiffnessHistory
from core.baseline.learning import learn
from core.baseline.settings import BaselineSettings
from core.change.shaft_response import ShaftResponse
from core.condition.operating_state import OperatingState
from core.monitor.catalogue import CATALOGUE
from core.quality import Reading, Reason, missing, uncertain
from service.store.documents import from_json, to_json
from service.store.port import StoreError
from service.store.references import GapReference, ReferenceSource, SetVectorReference
from service.store.sqlite import SqliteStore

T0 = 1_767_225_600_000_000_000


def reference(n: int = 0, **changes: object) -> GapReference:
    given = GapReference(
        "U1", "UJB", T0 + n, "A. Name", (1998.5 + n, 2003.1), None, ReferenceSource.GIVEN
    )
    return replace(given, **changes)  # type: ignore[arg-type]


def test_a_reference_is_read_back_to_the_last_bit(store):
    written = [
        reference(),
        reference(
            bearing="LJB",
            author="Müller, Ö. (maintenance)",
            gap_reference_um=(0.1 + 0.2, 10_000.0),
            opposite_reference_um=(5e-324, 1999.0),
            source=ReferenceSource.MEASURED,
            note="after the overhaul; shaft wedged, 21 °C",
        ),
    ]
    for each in written:
        store.gap_references.add(each)

    assert store.gap_references.in_force() == sorted(written, key=lambda r: r.bearing)
    assert [store.gap_references.history("U1", r.bearing) for r in written] == [
        [r] for r in written
    ]


def test_the_reference_set_last_rules_and_all_are_kept(store):
    for n in range(3):
        store.gap_references.add(reference(n))
        store.gap_references.add(reference(n, bearing="LJB"))
        store.gap_references.add(reference(n, unit="U2"))

    assert store.gap_references.in_force() == [
        reference(2, bearing="LJB"),
        reference(2),
        reference(2, unit="U2"),
    ]
    assert store.gap_references.history("U1", "UJB") == [reference(n) for n in (2, 1, 0)]
    assert store.gap_references.history("U1", "TJB") == []
    store.gap_references.add(reference(-1))  # by a clock that was put back
    assert (
        store.gap_references.in_force()[1]
        == store.gap_references.history("U1", "UJB")[0]
        == reference(-1)
    )


def test_what_another_process_has_set_is_seen(store, path):
    assert store.gap_references.in_force() == []
    other = SqliteStore(path)
    other.gap_references.add(reference())
    other.close()

    assert store.gap_references.in_force() == [reference()]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"gap_reference_um": (math.nan, 2000.0)},
            "gap x is nan µm; it must be above 0 and at most",
        ),
        (
            {"gap_reference_um": (2000.0, 0.0)},
            "gap y is 0 µm; it must be above 0 and at most 10000",
        ),
        ({"gap_reference_um": (-1.0, 2000.0)}, "gap x is -1 µm"),
        ({"gap_reference_um": (10_000.1, 2000.0)}, "gap x is 10000.1 µm"),
        ({"gap_reference_um": (math.inf, 2000.0)}, "gap x is inf µm"),
        ({"opposite_reference_um": (2000.0, math.nan)}, "opposite gap y is nan µm"),
        ({"author": ""}, "author is empty"),
        ({"author": "  "}, "author is empty"),
        ({"author": "a" * 81}, "author has 81 characters; it must have at most 80"),
        ({"author": "A\nB"}, "author has a line break or another unprintable character"),
        ({"note": "n" * 501}, "note has 501 characters; it must have at most 500"),
        ({"note": "\x1b[2J"}, "note has a line break or another unprintable character"),
    ],
)
def test_a_reference_outside_its_limits_is_refused_with_value_and_limit(changes, said):
    with pytest.raises(ValueError, match=said):
        reference(**changes)


def test_a_reference_that_makes_no_sense_is_an_error_of_the_store(store):
    store.gap_references.add(reference())
    with store.database.writing() as writer:
        writer.execute(
            "INSERT INTO gap_reference SELECT 7, unit, bearing, set_ns, '', x_um, y_um, NULL, NULL,"
            " source, note FROM gap_reference"
        )

    with pytest.raises(StoreError, match="unit U1 bearing UJB is invalid \\(author is empty"):
        store.gap_references.in_force()


def test_the_newest_readings_come_with_their_qualities(store):
    doubtful = Reading(1998.5, uncertain(Reason.NON_STATIONARY))
    store.append([assessment(at(2), gap_x_um=doubtful, gap_y_um=2003.1)], [])
    store.append([assessment(at(1), gap_x_um=7.0)], [])
    store.append([assessment(at(3), bearing="LJB", gap_x_um=8.0)], [])

    newest = store.newest("U1", "UJB")

    assert newest is not None
    assert newest.time_ns == at(2)
    assert newest.readings["gap_x_um"] == doubtful
    assert newest.readings["gap_y_um"] == Reading(2003.1)
    assert newest.readings["speed_rpm"] == missing(Reason.NOT_MEASURED)
    assert set(newest.readings) == {quantity.name for quantity in CATALOGUE}
    assert store.newest("U2", "UJB") is None


def test_only_the_newest_thousand_of_a_history_are_handed_out(store):
    with store._writing() as writer:
        writer.executemany(
            "INSERT INTO gap_reference (unit, bearing, set_ns, author, x_um, y_um, source, note)"
            " VALUES ('U1','UJB',?,'A. Name',2000.0,2000.0,'given','')",
            [(T0 + n,) for n in range(1001)],
        )

    history = store.gap_references.history("U1", "UJB")

    assert (len(history), history[0].set_ns, history[-1].set_ns) == (1000, T0 + 1000, T0 + 1)


FULL, PART = OperatingState.FULL_LOAD, OperatingState.PART_LOAD


def vector_reference(set_ns: int, state: OperatingState, amplitude: float) -> SetVectorReference:
    vectors = {"shaft_x": OrderVector(amplitude, 135.0), "bearing_y": OrderVector(20.0)}
    found = VectorReference("U1", "UJB", state, vectors)
    return SetVectorReference(found, set_ns, "E. Name", "after balancing")


def test_the_newest_of_each_operating_state_rules_also_after_a_restart(path):
    first, other, newest = (
        vector_reference(3, FULL, 60.0),
        vector_reference(2, PART, 90.0),
        vector_reference(1, FULL, 50),
    )
    store = SqliteStore(path)
    for each in (first, other, newest):  # by order of setting: a clock may be put back
        store.order1_references.add(each)
    store.close()

    again = SqliteStore(path)
    assert again.order1_references.in_force() == [other, newest]
    assert again.order1_references.history("U1", "UJB") == [newest, other, first]
    assert again.order1_references.history("U1", "TJB") == []
    again.close()


@pytest.mark.parametrize("vectors", ['{"shaft_x": [-1.0, null]}', '{"shaft_x": 7}'])
def test_a_reference_that_makes_no_sense_is_named(path, vectors):
    store = SqliteStore(path)
    store._writer.execute(
        "INSERT INTO vector_reference (unit, bearing, state, set_ns, author, note, vectors)"
        " VALUES ('U1', 'UJB', 5, 1, 'x', '', ?)",
        (vectors,),
    )
    with pytest.raises(StoreError, match="1× reference of unit U1 bearing UJB"):
        store.order1_references.in_force()
    store.close()


@pytest.fixture(scope="module")
def baseline(film_life: Callable[..., StiffnessHistory]) -> BearingBaseline:
    history = film_life(4, days=60)
    origin = Origin("U1", "LJB", "transfer_order1", 3, "Ada", 1_700_000_000_123_456_789, "overhaul")
    settled = np.ones(len(history), np.bool_)
    return learn(history, settled, origin, BaselineSettings())


def test_a_baseline_comes_back_as_it_was(baseline):
    assert from_json(BearingBaseline, to_json(baseline)) == baseline


def test_a_response_comes_back_as_it_was_unless_it_was_tampered_with():
    response = ShaftResponse((("UJB", "x"),), (20.0,), ((0.1, 0.2, 0.3),), (0.01,))
    assert from_json(ShaftResponse, to_json(response)) == response
    with pytest.raises(ValueError, match="std"):
        from_json(ShaftResponse, to_json(response).replace('"std": [', '"std": [-1.0, ', 1))


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
        ([*FIRST, "quantity"], "colour", "quantities.0: quantity must be one of k_x"),
        ([*FIRST, "scatter"], -1.0, "quantities.0: scatter and reading_h must be"),
        ([*FIRST, "surface", "coefficients"], [1.0], "coefficients, got 1"),
        ([*FIRST, "surface", "coefficients", 0], None, "coefficients.0: .* None"),
        ([*FIRST, "surface", "shape", "temperature", "width"], 0.0, "temperature: width must be"),
        ([*FIRST, "grid", "eccentricity_width"], -0.05, "grid: eccentricity_width = -0.05"),
        ([*FIRST, "table", "cells", 0, "support"], "some", "cells.0.support: .* 'some'"),
        ([*FIRST, "table", "cells", 0, "cell"], [99, 99, 99], "must have the same number of axes"),
        ([*FIRST, "time_scatter", 0, "time_scale_h"], 1e9, "must increase"),
    ],
)
def test_a_baseline_that_was_tampered_with_is_refused(baseline, path, value, says):
    content = json.loads(to_json(baseline))
    change(content, path, value)
    with pytest.raises(ValueError, match=says):
        from_json(BearingBaseline, json.dumps(content))


@pytest.mark.parametrize(
    "text",
    ["", "[]", "{", "null", '{"format": 1, "format": 2}', '{"a": NaN}', "[" * 100_000],
)
def test_what_is_no_baseline_is_refused(text):
    with pytest.raises(ValueError, match=r".+"):
        from_json(BearingBaseline, text)


def test_a_huge_number_is_refused(baseline):
    text = to_json(baseline).replace('"scatter": ', '"scatter": 1e999, "x": ', 1)
    with pytest.raises(ValueError, match=r".+"):
        from_json(BearingBaseline, text)
