"""The line of a stiff shaft: learned from its motion, broken by a gain and by nothing else."""

import math

import numpy as np
import pytest

from core.arrays import ComplexArray
from core.baseline.history import ReadingOutcome, StiffnessHistory
from core.change.cause import Cause
from core.change.decision import Verdict
from core.change.film_judge import FilmFinding, FilmJudge, alarm_condition
from core.change.film_reading import FilmReading, FilmValue
from core.change.settings import ChangeLimits, FilmRules
from core.change.shaft_line import LineFinding, LineVerdict, ShaftLine, learn_lines
from core.change.shaft_response import learn_response
from core.condition.cells import BearingCondition, CellGrid
from core.condition.operating_state import OperatingLimits, OperatingState
from core.machine.unit import Estimator
from core.quality import Reason

HEIGHTS_M = {"UJB": 5.4, "LJB": 0.1, "TJB": -8.8}
N = 4800
PROBE_GAINS, BEARING_GAINS = np.array([1.03, 0.98, 1.04]), np.array([0.97, 1.02, 1.0])
ROW = {"x": 0, "y": 1}


def motion(seed: int, bend_um: float = 0.0, n: int = N) -> ComplexArray:
    """Phasors (3, 2, 2, n) by bearing, part and direction, as read with gains, runout and noise."""
    random = np.random.default_rng(seed)

    def wanders(size: float) -> ComplexArray:
        steps = random.normal(size=(2, 2, n // 24)) @ np.diag(np.ones(n // 24))
        real, imaginary = np.repeat(steps, 24, axis=2)
        return size * (real + 1j * imaginary)

    shift, tilt = 20.0 + wanders(3.0), 1.5j + wanders(0.4)
    found = np.empty((3, 2, 2, n), np.complex128)
    bend = bend_um * (1.0 + np.abs(wanders(1.0)))
    for row, height_m in enumerate(HEIGHTS_M.values()):
        whole = shift + tilt * height_m + (bend if row == 1 else 0.0)
        share = (0.4 + 0.05 * row) * np.exp(0.25j) * (1.0 + 0.1 * wanders(1.0).real)
        found[row, 0] = PROBE_GAINS[row] * ((1.0 - share) * whole + 0.8 - 0.3j)
        found[row, 1] = BEARING_GAINS[row] * share * whole
    found[:, 0] += 0.15 * random.normal(size=(3, 2, n)) + 0.15j * random.normal(size=(3, 2, n))
    found[:, 1] += 0.02 * random.normal(size=(3, 2, n)) + 0.02j * random.normal(size=(3, 2, n))
    return found


def histories(phasors: ComplexArray) -> dict[str, StiffnessHistory]:
    one, pair = np.ones(phasors.shape[-1]), np.ones((2, phasors.shape[-1]))
    return {
        name: StiffnessHistory(
            *(np.arange(one.size), one, one, one, one, one, one, pair, pair),
            *np.abs(own),
            shaft_phase_deg=np.degrees(np.angle(own[0])),
            bearing_phase_deg=np.degrees(np.angle(own[1])),
        )
        for name, own in zip(HEIGHTS_M, phasors, strict=True)
    }


def lines(phasors: ComplexArray) -> tuple[ShaftLine, ...]:
    return learn_lines(histories(phasors), np.ones(phasors.shape[-1], np.bool_))


def finding(phasors: ComplexArray, bearing: str, direction: str, ln_k: float) -> LineFinding:
    """Of a line learned from other motion, with six days of readings and a flat baseline."""
    line = next(each for each in lines(motion(1)) if each.direction == direction)
    own = phasors[:, :, ROW[direction], :864]
    changes = np.zeros((3, 864))
    changes[list(HEIGHTS_M).index(bearing)] = ln_k
    return line.judge(own[:, 0], own[:, 1], changes, np.zeros((3, 864)))


def test_the_line_is_that_of_the_heights_and_gains():
    upper, middle, lower = HEIGHTS_M.values()
    true = np.array([1.0, -(upper - lower) / (middle - lower), (upper - middle) / (middle - lower)])
    for line in lines(motion(1)):
        probe = true / PROBE_GAINS
        np.testing.assert_allclose(line.probe, probe / probe[0], rtol=0.06)
        np.testing.assert_allclose(line.accelerometer, true / BEARING_GAINS / probe[0], rtol=0.06)
        assert line.std_um < 0.12


@pytest.mark.parametrize("row", range(3))
@pytest.mark.parametrize("direction", ["x", "y"])
def test_a_changed_gain_breaks_the_line_and_is_told_from_the_other(row, direction):
    bearing = list(HEIGHTS_M)[row]
    for part, named in enumerate((LineVerdict.PROBE, LineVerdict.ACCELEROMETER)):
        changed = motion(2)
        changed[row, part, ROW[direction]] *= 1.05
        ln_k = math.log(1.05) * (-1.0, 1.0)[part]
        found = finding(changed, bearing, direction, ln_k)
        assert (found.verdict, found.bearing, found.is_alarming) == (named, bearing, True)
        assert found.ln_gain == pytest.approx(math.log(1.05), abs=0.005)


def test_a_film_or_bracket_that_changes_leaves_the_line():
    changed = motion(2)
    moved = 0.1 * changed[0, 1] / BEARING_GAINS[0]
    changed[0, 1] += BEARING_GAINS[0] * moved  # what the bracket yields, the film does not
    changed[0, 0] -= PROBE_GAINS[0] * moved
    assert finding(changed, "UJB", "x", 0.15).verdict is LineVerdict.HOLDS
    assert finding(motion(2), "UJB", "x", 0.001).verdict is LineVerdict.UNKNOWN  # none would show


def test_a_line_broken_elsewhere_names_no_transducer_of_the_film():
    changed = motion(2)
    changed[2, 0] *= 1.2
    found = finding(changed, "UJB", "x", -0.1)
    assert (found.verdict, found.bearing) == (LineVerdict.BROKEN, None)


def test_a_new_gain_is_found_while_few_of_the_kept_readings_have_it():
    changed = motion(2)
    changed[1, 0, :, 864 - 144 : 864] *= 1.05
    found = finding(changed, "LJB", "x", -math.log(1.05))
    assert found.ln_gain == pytest.approx(math.log(1.05), abs=0.005)
    quiet = motion(2)
    quiet[1, 0] *= 1.01
    assert not finding(quiet, "LJB", "x", -0.01).is_alarming


def alerts(judge: FilmJudge, phasors: ComplexArray, ln_k: float, time_ns: int) -> list[str]:
    """Films with an alert after six days of motion in which k of the LJB in x reads ln_k more."""
    shaft, bearing = (
        phasors[..., :864].reshape(3, 2, 2, 864).transpose(1, 0, 2, 3).reshape(2, 6, 864)
    )
    changes = np.zeros((6, 864))
    changes[2] = ln_k
    rest = np.zeros((2, 6, 864))
    parts = (shaft.real, shaft.imag, bearing.real, bearing.imag)
    columns = np.stack([21.0 + changes, np.log(np.abs(shaft)), changes, *rest, *parts])
    judge.add_recent(columns.transpose(2, 0, 1))
    nothing = FilmValue(*[math.nan] * 4, ReadingOutcome.BAD_QUALITY, Reason.NOT_MEASURED)
    condition = BearingCondition(OperatingState.UNKNOWN, False, None)
    place = (time_ns, condition, *[math.nan] * 6, (nothing, nothing))
    news = judge.judge([FilmReading("U1", b, Estimator.DYNAMIC, *place) for b in HEIGHTS_M])
    found = [(one.reading.bearing, f) for one in news for f in one.findings if f.level]
    assert all(each.attribution.cause is Cause.TRANSDUCER for _, each in found)
    return [f"{bearing} {each.quantity}" for bearing, each in found]


def test_a_gain_raises_an_alert_of_its_film_before_stiffness_does_and_ends_it():
    settled = np.ones(N, np.bool_)
    limits = OperatingLimits(92.3, 330.0)
    films = dict.fromkeys(HEIGHTS_M, Estimator.DYNAMIC)
    rules = FilmRules(films, CellGrid(), limits, ChangeLimits(), 600 * 10**9)
    judge = FilmJudge(rules, dict.fromkeys(HEIGHTS_M))
    judge.response = learn_response(histories(motion(1)), settled)
    changed = motion(2)
    changed[1, 0, 0] *= 1.05
    assert alerts(judge, motion(2), 0.0, 1) == []
    assert alerts(judge, changed, -math.log(1.05), 2) == ["LJB k_x"]
    assert alerts(judge, motion(3), 0.0, 3) == []
    said = FilmFinding(Verdict.NORMAL, change=-0.03).in_alert()
    assert alarm_condition([said, FilmFinding(Verdict.NORMAL, quantity="ck_x")], "x").level


def test_without_a_stiff_shaft_three_bearings_and_phases_there_is_no_line():
    assert lines(motion(1, bend_um=5.0)) == ()
    found = histories(motion(1))
    settled = np.ones(N, np.bool_)
    assert learn_lines({b: h for b, h in found.items() if b != "TJB"}, settled) == ()
    unknown = motion(1)
    unknown[0] = np.nan
    assert lines(unknown) == ()
    assert lines(motion(1, n=480)) == ()
    [line, _] = lines(motion(1))
    nothing = np.full((3, 4), np.nan + 0j)
    assert line.judge(nothing, nothing, *np.zeros((2, 3, 4))).verdict is LineVerdict.UNKNOWN
    falling = np.full((3, 4), 0.3), np.full((3, 4), -1.0)
    assert line.judge(*np.ones((2, 3, 4), np.complex128), *falling).std_um
