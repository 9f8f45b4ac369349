"""Recordings of both kinds on one shelf, and the motion of a shaft out of their samples."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from rigs.capturing import block, recorded_unit

from acquisition.recordings.writer import RecordingWriter
from core.arrays import FloatArray
from core.machine.channel import Channel, Measurand
from core.machine.unit import Bearing, Unit
from core.quality import Reading
from service.live.samples import SampleWindow
from service.recordings.library import RecordingLibrary
from service.recordings.motion import ShaftMotion, motion_of
from service.store.waveforms import WaveformKind

RATE_HZ, TURN_HZ, N = 600.0, 1.5, 6000
TURNS = TURN_HZ * np.arange(N) / RATE_HZ
GROWTH_UM, CENTRE_X_UM, CENTRE_Y_UM = 40.0, -30.0, 75.0


def machine(**changes: object) -> Unit:
    gaps = [Channel(id_, Measurand.GAP_UM, -1) for id_ in ("x", "y", "far_x", "far_y")]
    bearing = Bearing(
        id="UJB",
        bracket_stiffness_n_per_m=1e9,
        shaft_x="x",
        shaft_y="y",
        bearing_x="v",
        bearing_y="v",
        clearance_um=200.0,
        gap_reference_um=(2000.0, 2100.0),
        opposite_x="far_x",
        opposite_y="far_y",
        opposite_reference_um=(1900.0, 1950.0),
    )
    settings: dict[str, object] = {
        "id": "U1",
        "rated_speed_rpm": 90.0,
        "rate_hz": RATE_HZ,
        "channels": (*gaps, Channel("mark", Measurand.KEY_PHASE_V, -1)),
        "bearings": (bearing,),
        "key_phase": "mark",
        "speed_channel": "speed",
    }
    return Unit(**{**settings, **changes})  # type: ignore[arg-type]


def stretch(slow: Mapping[str, Reading] | None = None, **changes: FloatArray) -> SampleWindow:
    """A circle of 50 µm from x to y about a centre; all gaps have grown; pulses fall."""
    x = CENTRE_X_UM + 50.0 * np.cos(2.0 * math.pi * TURNS)
    y = CENTRE_Y_UM + 50.0 * np.sin(2.0 * math.pi * TURNS)
    samples = {
        "x": 2000.0 + GROWTH_UM - x,
        "y": 2100.0 + GROWTH_UM - y,
        "far_x": 1900.0 + GROWTH_UM + x,
        "far_y": 1950.0 + GROWTH_UM + y,
        "mark": np.where((TURNS + 0.3) % 1.0 < 0.02, -5.0, 0.0),
    }
    return SampleWindow(1, 0, 0, RATE_HZ, {**samples, **changes}, slow or {"speed": Reading(91.0)})


def motion(given: SampleWindow, **changes: object) -> ShaftMotion:
    unit = machine(**changes)
    return motion_of(given, unit, unit.bearings[0])


def test_four_probes_tell_the_centre_from_growth_and_the_mark_gives_speed_and_turns():
    found = motion(stretch())

    assert found.marks is not None
    expected = (np.arange(1.0, 16.0) - 0.3) / TURN_HZ * RATE_HZ
    assert found.marks == pytest.approx(expected, abs=1.0)
    assert found.speed_rpm == pytest.approx(90.0)  # not the slow channel's
    assert found.centre_um == pytest.approx((CENTRE_X_UM, CENTRE_Y_UM), abs=0.01)
    assert found.x_um == pytest.approx(50.0 * np.cos(2.0 * math.pi * TURNS), abs=0.01)
    assert found.order1 is not None
    ellipse = found.order1.ellipse
    assert (ellipse.major_um_pk, ellipse.minor_um_pk) == pytest.approx((50.0, 50.0), rel=1e-3)
    assert ellipse.sense == 1


def test_without_a_key_phase_there_are_no_marks_and_the_slow_channel_says_the_speed():
    found = motion(stretch(), key_phase=None)
    assert found.marks is None
    assert found.speed_rpm == 91.0


def test_a_lost_probe_leaves_no_motion_no_centre_and_no_zeros():
    lost = np.full(N, np.nan)
    found = motion(stretch(y=lost, far_y=lost))
    assert np.isnan(found.y_um).all()
    assert np.isfinite(found.x_um).all()
    assert (found.centre_um, found.order1) == (None, None)


@pytest.mark.parametrize("n_samples", [1, 2, 3, 50])
def test_a_moment_too_short_for_a_turn_is_motion_without_its_part_at_running_speed(n_samples):
    whole = stretch()
    short = {id_: each[:n_samples] for id_, each in whole.samples.items()}
    found = motion(SampleWindow(1, 0, 0, RATE_HZ, short, whole.slow))
    assert found.x_um.size == n_samples
    assert found.order1 is None


FIRST = "U1-20260101T000000.000Z-continuous"
CAPTURE = "U1-20260101T000500.000Z-order1_shaft_x"
SECOND = "U1-20260101T001000.000Z-continuous-2"
OTHER = "U2-20260101T000200.000Z-continuous"
LONGER = "U1-2-20260101T000100.000Z-continuous"


def make(folder: Path) -> None:
    unit = folder.name[:2]
    folder.parent.mkdir(exist_ok=True)
    with RecordingWriter(folder, recorded_unit(unit), "a test") as writer:
        writer.write(block(0, unit))


@pytest.fixture
def shelf(tmp_path: Path) -> RecordingLibrary:
    captures, recordings = tmp_path / "captures", tmp_path / "recordings"
    make(captures / CAPTURE)
    for name in (FIRST, SECOND, OTHER, LONGER):
        make(recordings / name)
    (recordings / "U1-20260101T002000.000Z-continuous.parts").mkdir()
    return RecordingLibrary((captures, recordings))


@pytest.mark.parametrize(
    ("asked", "names"),
    [
        ((10,), [SECOND, CAPTURE, OTHER, LONGER, FIRST]),
        ((2, "U1"), [SECOND, CAPTURE]),
        ((10, None, WaveformKind.CAPTURE), [CAPTURE]),
        ((10, "U1", WaveformKind.CONTINUOUS), [SECOND, FIRST]),
        ((10, "U1-2"), [LONGER]),
    ],
)
def test_whole_recordings_are_listed_newest_first_by_unit_and_kind(shelf, asked, names):
    found = shelf.newest(*asked)
    assert [kept.name for kept in found] == names
    assert {kept.kind for kept in found} >= set(asked[2:])


def test_one_of_either_kind_is_opened_by_its_name(shelf):
    assert shelf.opened(CAPTURE).manifest.unit == "U1"
    assert shelf.opened(OTHER).manifest.unit == "U2"
    assert shelf.one("../captures") is None
