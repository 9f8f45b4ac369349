"""A monitor takes a new description of its unit over without losing what it has averaged."""

from dataclasses import replace

import numpy as np
import pytest
from rigs.blocks import with_quality

from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.monitor.assessment import AnalysisSettings
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD, Reason, bad
from core.samples.blocks import SampleBlock

SEGMENT, HOP = 8192, 7168


@pytest.fixture
def stream(blocks, signals) -> list[SampleBlock]:
    """Six segments of a shaft that turns about (30, 40) µm, with gaps of 2000 µm at its centre."""
    rows = signals((SEGMENT + 5 * HOP) / 600.0, gaps_um=(1970.0, 1960.0))
    return list(blocks(rows, n_each=HOP))


def with_reference(unit: Unit, gap_reference_um: tuple[float, float]) -> Unit:
    (bearing,) = unit.bearings
    return replace(unit, bearings=(replace(bearing, gap_reference_um=gap_reference_um),))


def test_a_new_reference_moves_the_shaft_centre_and_nothing_else_from_the_next_result_on(
    unit: Unit, stream
) -> None:
    monitor = UnitMonitor(unit, AnalysisSettings())
    before = [a for block in stream[:3] for a in monitor.ingest(block)]

    monitor.replace_description(with_reference(unit, (1970.0, 2000.0)))
    after = [a for block in stream[3:] for a in monitor.ingest(block)]

    assert before[-1].readings["eccentricity_ratio"].value == pytest.approx(0.25, abs=0.01)
    assert after[0].readings["shaft_centre_x_um"].value == pytest.approx(0.0, abs=1.0)
    assert after[0].readings["shaft_centre_y_um"].value == pytest.approx(40.0, abs=1.0)
    assert after[0].readings["eccentricity_ratio"].value == pytest.approx(0.2, abs=0.01)
    assert after[0].window.n_segments == before[-1].window.n_segments + 1
    assert monitor.unit.bearings[0].gap_reference_um == (1970.0, 2000.0)

    results = []
    for reference in ((2000.0, 2000.0), (1970.0, 2000.0)):
        monitor = UnitMonitor(unit, AnalysisSettings())
        monitor.replace_description(with_reference(unit, reference))
        results.append([a for block in stream for a in monitor.ingest(block)][-1].readings)

    differing = {name for name in results[0] if results[0][name] != results[1][name]}

    assert differing == {"shaft_centre_x_um", "eccentricity_ratio", "attitude_angle_deg"}


def test_growth_since_an_older_reference_is_forgotten(unit: Unit, blocks, signals) -> None:
    """All gaps have grown by 35 µm since the reference; then the opposite probe in x is lost."""
    (bearing,) = unit.bearings
    three = replace(bearing, opposite_x="fx", opposite_reference_um=(2000.0, 2000.0))
    fourth = Channel("fx", Measurand.GAP_UM, 1)
    unit = replace(unit, channels=(*unit.channels, fourth), bearings=(three,))
    rows = signals((SEGMENT + 5 * HOP) / 600.0, gaps_um=(2005.0, 1995.0))
    rows = np.vstack([rows, 4000.0 + 2 * 35.0 - rows[0]])
    lost = (*(GOOD,) * 4, bad(Reason.SENSOR_FAILURE))
    stream = [
        block if n < 4 else with_quality(block, lost)
        for n, block in enumerate(blocks(rows, n_each=HOP))
    ]
    for reference in ((2000.0, 2000.0), (2035.0, 2035.0)):
        monitor = UnitMonitor(unit, AnalysisSettings())
        found = [a for block in stream[:4] for a in monitor.ingest(block)]
        assert found[-1].readings["gap_growth_um"].value == pytest.approx(35.0, abs=1.0)
        anew = replace(three, gap_reference_um=reference)
        monitor.replace_description(replace(unit, bearings=(anew,)))
        found = [a for block in stream[4:] for a in monitor.ingest(block)]
        assert found[-1].readings["shaft_centre_y_um"].value == pytest.approx(40.0, abs=1.0)


SWAPPED = Bearing("UJB", 1.18e9, "sy", "sx", "bx", "by", 200.0, (2000.0, 2000.0), "oil")


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"id": "U2"}, "id is 'U2', expected 'U1'"),
        ({"rate_hz": 1000.0}, r"rate_hz is 1000\.0, expected 600\.0"),
        ({"channels": ()}, r"channels is \(\), expected \(Channel"),
        ({"rated_speed_rpm": 100.0}, r"rated_speed_rpm is 100\.0, expected 92\.3"),
        ({"speed_channel": None}, "speed_channel is None, expected 'speed'"),
        ({"bearings": ()}, r"bearings is \(\), expected \(\('UJB', "),
        ({"bearings": (SWAPPED,)}, "'sy', 'sx', 'bx', 'by'"),
    ],
)
def test_another_machine_is_refused_naming_what_differs(
    unit: Unit, changes: dict[str, object], said: str
) -> None:
    monitor = UnitMonitor(unit, AnalysisSettings())

    with pytest.raises(ValueError, match=said):
        monitor.replace_description(replace(unit, **changes))  # type: ignore[arg-type]

    assert monitor.unit is unit
