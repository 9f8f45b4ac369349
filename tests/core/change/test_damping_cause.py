"""What c/k and the line of the shaft say of the cause of a change."""

from dataclasses import replace

import pytest

from core.change.cause import PROBE_REASON, Attribution, Cause
from core.change.damping_cause import cause_by_damping
from core.change.evidence import Finding
from core.change.shaft_line import LineFinding, LineVerdict

BY_MOTION = Attribution(Cause.UNKNOWN, "shaft motion agrees with more than one cause")
HOLDS = LineFinding(LineVerdict.HOLDS, 0.02, 0.03)
NO_LINE = LineFinding()


def evidence(k_x: float, k_y: float, ck: float, ck_std: float = 0.002) -> dict[str, list[Finding]]:
    """Changes of one bearing over one time scale, by quantity."""
    both = {f"ck_{direction}": [Finding(16.0, ck, ck_std)] for direction in "xy"}
    return {"k_x": [Finding(16.0, k_x, 0.008)], "k_y": [Finding(16.0, k_y, 0.008)], **both}


def told(
    own: dict[str, list[Finding]],
    others: tuple[float, ...] = (0.0, 0.0),
    line: LineFinding = HOLDS,
    found: Attribution = BY_MOTION,
) -> Attribution:
    films = {("UJB", name): one for name, one in own.items()}
    for bearing, k in zip(("LJB", "TJB"), others, strict=False):
        films |= {(bearing, name): one for name, one in evidence(k, k, 0.0).items()}
    return cause_by_damping(("UJB", "x"), found, films, {"x": line, "y": HOLDS})


@pytest.mark.parametrize(
    ("own", "others", "cause"),
    [
        (evidence(-0.22, -0.22, 0.001), (-0.2, -0.2), Cause.OIL),
        (evidence(-0.22, -0.22, 0.001), (0.0, 0.0), Cause.OIL),
        (evidence(-0.3, -0.28, 0.03), (0.0, 0.0), Cause.CLEARANCE),
        (evidence(0.01, -0.01, 0.016), (0.0, 0.0), Cause.CLEARANCE),
        (evidence(0.16, 0.15, 0.001), (0.0, 0.0), Cause.BRACKET),
        (evidence(0.16, 0.15, 0.001), (0.14, 0.17), Cause.OIL),
        (evidence(-0.2, 0.0, 0.001), (0.0, 0.0), Cause.UNKNOWN),  # one direction alone
        (evidence(-0.05, -0.05, 0.001), (0.0, 0.0), Cause.UNKNOWN),  # c/k could not show it
        (evidence(-0.22, -0.22, 0.001, 0.01), (0.0, 0.0), Cause.UNKNOWN),
        (evidence(-0.22, -0.22, -0.03), (0.0, 0.0), Cause.UNKNOWN),
    ],
)
def test_oil_clearance_and_bracket_are_told_by_what_c_over_k_does(own, others, cause):
    found = told(own, others)
    assert found.cause is cause
    if cause is not Cause.UNKNOWN:
        assert "c/k" in found.reason
        assert "%" in found.reason


def test_a_film_that_stiffens_alone_is_a_bracket_if_the_line_holds():
    as_film = Attribution(Cause.FILM, "shaft motion agrees with films of the measured stiffness")
    stiffer = evidence(0.16, 0.15, 0.001)
    assert told(stiffer, found=as_film).cause is Cause.BRACKET
    assert told(stiffer, line=NO_LINE, found=as_film) == as_film
    assert told(evidence(-0.2, -0.2, 0.001), line=NO_LINE, found=as_film).cause is Cause.OIL


@pytest.mark.parametrize("which", [LineVerdict.PROBE, LineVerdict.ACCELEROMETER])
def test_a_broken_line_names_the_transducer_whatever_c_over_k_does(which):
    broken = LineFinding(which, 0.8, 0.03, "UJB", -0.05)
    found = told(evidence(-0.1, -0.02, 0.012), line=broken)
    assert found.cause is Cause.TRANSDUCER
    assert f"{which} of UJB in x" in found.reason
    assert "-4.9 %, 0.80 ± 0.03 µm" in found.reason
    assert told({}, line=broken).cause is Cause.TRANSDUCER
    elsewhere = replace(broken, bearing="TJB")
    assert told(evidence(-0.3, -0.28, 0.03), line=elsewhere).cause is Cause.CLEARANCE


def test_without_a_line_a_bracket_is_not_told_from_transducers():
    assert told(evidence(0.16, 0.15, 0.001), line=NO_LINE) == BY_MOTION
    assert told(evidence(-0.3, -0.28, 0.03), line=NO_LINE).cause is Cause.CLEARANCE
    probes = Attribution(Cause.BRACKET_OR_TRANSDUCER, PROBE_REASON)
    assert told(evidence(-0.3, -0.28, 0.03), line=NO_LINE, found=probes) == probes


def test_without_damping_the_motion_of_the_shaft_alone_tells():
    assert told({}) == BY_MOTION
    changes = evidence(-0.3, -0.3, 0.0)
    assert told({name: changes[name] for name in ("k_x", "k_y")}) == BY_MOTION
