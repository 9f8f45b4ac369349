"""A monitor takes a new description of its unit over without losing what it has averaged."""

from dataclasses import replace

import numpy as np
import pytest

from core.arrays import FloatArray
from core.machine import Bearing, Channel, Measurand, Unit
from core.monitor import UnitMonitor
from core.quality import GOOD, Reason, bad
from core.settings import AnalysisSettings

SEGMENT, HOP = 8192, 7168


def shaft_at(x_um: float, y_um: float, n_segments: int) -> FloatArray:
    """Gaps of a shaft turning about a point off its centre, whose gaps are 2000 µm."""
    n_samples = SEGMENT + (n_segments - 1) * HOP
    turn = 2 * np.pi * 92.3 / 60 * np.arange(n_samples) / 600.0
    return np.array(
        [
            2000 - x_um - 60 * np.cos(turn),
            2000 - y_um - 60 * np.sin(turn),
            20 * np.cos(turn),
            20 * np.sin(turn),
        ]
    ) + 0.05 * np.random.default_rng(2).normal(size=(4, n_samples))


def with_reference(unit: Unit, gap_reference_um: tuple[float, float]) -> Unit:
    (bearing,) = unit.bearings
    return replace(unit, bearings=(replace(bearing, gap_reference_um=gap_reference_um),))


def test_a_new_reference_moves_the_shaft_centre_from_the_next_result_on(unit: Unit, blocks) -> None:
    monitor = UnitMonitor(unit, AnalysisSettings())
    stream = list(blocks(shaft_at(30.0, 40.0, n_segments=6), n_each=HOP))
    before = [a for block in stream[:3] for a in monitor.ingest(block)]

    monitor.adopt(with_reference(unit, (1970.0, 2000.0)))
    after = [a for block in stream[3:] for a in monitor.ingest(block)]

    assert before[-1].readings["eccentricity_ratio"].value == pytest.approx(0.25, abs=0.01)
    assert after[0].readings["shaft_centre_x_um"].value == pytest.approx(0.0, abs=1.0)
    assert after[0].readings["shaft_centre_y_um"].value == pytest.approx(40.0, abs=1.0)
    assert after[0].readings["eccentricity_ratio"].value == pytest.approx(0.2, abs=0.01)
    assert after[0].window.n_segments == before[-1].window.n_segments + 1
    assert monitor.unit.bearings[0].gap_reference_um == (1970.0, 2000.0)


def test_nothing_but_the_position_depends_on_the_reference(unit: Unit, blocks) -> None:
    stream = list(blocks(shaft_at(30.0, 40.0, n_segments=5), n_each=HOP))
    results = []
    for reference in ((2000.0, 2000.0), (1970.0, 2000.0)):
        monitor = UnitMonitor(unit, AnalysisSettings())
        monitor.adopt(with_reference(unit, reference))
        results.append([a for block in stream for a in monitor.ingest(block)][-1].readings)

    differing = {name for name in results[0] if results[0][name] != results[1][name]}

    assert differing == {"shaft_centre_x_um", "eccentricity_ratio", "attitude_angle_deg"}


def test_growth_since_an_older_reference_is_forgotten(unit: Unit, blocks) -> None:
    """All gaps have grown by 35 µm since the reference; then the opposite probe in x is lost."""
    (bearing,) = unit.bearings
    three = replace(bearing, opposite_x="fx", opposite_reference_um=(2000.0, 2000.0))
    unit = replace(
        unit,
        channels=(*unit.channels, Channel("fx", Measurand.GAP_UM, 1)),
        bearings=(three,),
    )
    signals = shaft_at(30.0, 40.0, n_segments=6)
    signals[:2] += 35.0
    opposite = 4000.0 + 2 * 35.0 - signals[0]
    stream = [
        replace(
            block,
            samples=np.vstack([block.samples, far[np.newaxis]]).astype(np.float32),
            channel_quality=(*block.channel_quality, GOOD if n < 4 else bad(Reason.SENSOR_FAILURE)),
        )
        for n, block in enumerate(blocks(signals, n_each=HOP))
        for far in [opposite[n * HOP : n * HOP + block.n_samples]]
    ]
    centres = []
    for reference in ((2000.0, 2000.0), (2035.0, 2035.0)):
        monitor = UnitMonitor(unit, AnalysisSettings())
        found = [a for block in stream[:4] for a in monitor.ingest(block)]
        assert found[-1].readings["gap_growth_um"].value == pytest.approx(35.0, abs=1.0)
        anew = replace(three, gap_reference_um=reference)
        monitor.adopt(replace(unit, bearings=(anew,)))
        found = [a for block in stream[4:] for a in monitor.ingest(block)]
        centres.append(found[-1].readings["shaft_centre_y_um"].value)

    assert centres == pytest.approx([40.0, 40.0], abs=1.0)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"id": "U2"}, "id is 'U2', is 'U1' here"),
        ({"rate_hz": 1000.0}, r"rate_hz is 1000\.0, is 600\.0 here"),
        ({"channels": ()}, r"channels is \(\), is \(Channel"),
        ({"rated_speed_rpm": 100.0}, r"rated_speed_rpm is 100\.0, is 92\.3 here"),
        ({"speed_channel": None}, "speed_channel is None, is 'speed' here"),
        ({"bearings": ()}, r"bearings is \(\), is \(\('UJB', "),
    ],
)
def test_another_machine_is_refused_naming_what_differs(
    unit: Unit, changes: dict[str, object], said: str
) -> None:
    monitor = UnitMonitor(unit, AnalysisSettings())

    with pytest.raises(ValueError, match=said):
        monitor.adopt(replace(unit, **changes))  # type: ignore[arg-type]

    assert monitor.unit is unit


def test_a_bearing_on_other_channels_is_refused(unit: Unit) -> None:
    (bearing,) = unit.bearings
    swapped: Bearing = replace(bearing, shaft_x="sy", shaft_y="sx")

    with pytest.raises(ValueError, match="'sy', 'sx', 'bx', 'by'"):
        UnitMonitor(unit, AnalysisSettings()).adopt(replace(unit, bearings=(swapped,)))
