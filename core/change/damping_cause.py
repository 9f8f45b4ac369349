"""Cause of a change by damping over stiffness c/k: oil, clearance, bracket or transducer.

A change of the oil moves stiffness and damping alike and leaves c/k. More clearance lowers k and
raises c/k. The stiffness of the bracket and the gains of transducers cancel in c/k. With the line
through three bearings (`core.change.shaft_line`), a transducer is distinguished from the rest.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from core.baseline.history import QUANTITIES
from core.change.cause import MIN_RELATIVE_CHANGE, PROBE_REASON, Attribution, Cause, UnitReadings
from core.change.evidence import Finding
from core.change.settings import percent_of
from core.change.shaft_line import LineFinding, LineVerdict
from core.change.shaft_response import FilmDirection, ShaftResponse

CLEARANCE_SHARE = 0.08
"""Smallest change of ln c/k relative to that of -ln k, by a change of clearance. By Reynolds'
equation for the pads of Brito et al. it is 0.085 to 0.115 (`benchmarks/pads.py`)."""

SURE = 4.0
"""Required significance of a change of c/k, in standard uncertainties."""

TELLING = 4.0
"""Required size of the change of c/k that a clearance would cause, in standard uncertainties, to
exclude the clearance if c/k has moved by less than half of it."""

ALIKE = 0.35
"""Largest difference of the changes in x and y, relative to the larger one, to count as alike."""


Evidence: TypeAlias = Mapping[tuple[str, str], Sequence[Finding]]
"""Mean deviations over each time scale, by bearing id and name of one of the `QUANTITIES`."""


@dataclass(frozen=True)
class _Bearing:
    """Mean changes of one bearing over a time scale, with standard uncertainties.

    `k` are the changes of ln k in x and y, `k_std` the larger of their uncertainties; `ck` is the
    mean change of ln c/k in both directions.
    """

    time_scale_h: float
    k: tuple[float, float]
    k_std: float
    ck: float
    ck_std: float

    @property
    def mean_k(self) -> float:
        """Mean change of ln k in both directions."""
        return sum(self.k) / 2.0

    @property
    def is_alike(self) -> bool:
        """Whether k changed alike in x and y."""
        x, y = self.k
        return abs(x - y) <= max(ALIKE * max(abs(x), abs(y)), 3.0 * self.k_std)

    @property
    def expected(self) -> float:
        """Smallest change of ln c/k if a change of clearance had moved k; negative if k rose."""
        return -CLEARANCE_SHARE * self.mean_k

    @property
    def power(self) -> float:
        """Larger of the expected and the found change of c/k, in standard uncertainties."""
        return max(abs(self.expected), abs(self.ck)) / self.ck_std

    @property
    def is_less(self) -> bool:
        """Whether c/k has moved by less than half of what a change of clearance would do."""
        return self.ck * math.copysign(1.0, self.expected) < abs(self.expected) / 2.0

    @property
    def is_unmoved(self) -> bool:
        """Whether c/k shows that the clearance has not changed k."""
        is_small = abs(self.ck) < abs(self.expected) / 2.0
        return is_small and abs(self.expected) >= TELLING * self.ck_std

    @property
    def is_moved(self) -> bool:
        """Whether c/k has surely changed, by as much as a change of clearance would do."""
        is_kept = abs(self.mean_k) < SURE * self.k_std
        return abs(self.ck) >= SURE * self.ck_std and (is_kept or not self.is_less)

    def follows(self, other: "_Bearing") -> bool:
        """Whether k of this bearing changed together with that of another."""
        share = self.mean_k / other.mean_k if other.mean_k else 0.0
        return share >= MIN_RELATIVE_CHANGE and abs(self.mean_k) >= 3.0 * self.k_std

    @property
    def words(self) -> str:
        """Numbers of the changes."""
        x, y = (f"{percent_of(each):+.1f} %" for each in self.k)
        std = 100.0 * self.ck_std
        hours = f"mean over {self.time_scale_h:g} h"
        return f"k {x} in x, {y} in y; c/k {percent_of(self.ck):+.1f} ± {std:.1f} % ({hours})"


def _bearing(
    evidence: Evidence, bearing: str, time_scale_h: float | None = None
) -> _Bearing | None:
    """Return the changes of a bearing over a time scale, by default the most telling one."""
    columns = [
        {finding.time_scale_h: finding for finding in evidence.get((bearing, name), ())}
        for name in QUANTITIES
    ]
    found = []
    for scale_h in set.intersection(*map(set, columns)):
        k_x, k_y, ck_x, ck_y = (column[scale_h] for column in columns)
        k, ck = (k_x.change, k_y.change), (ck_x.change + ck_y.change) / 2.0
        std = math.hypot(ck_x.std, ck_y.std) / 2.0
        if time_scale_h in (None, scale_h):
            found.append(_Bearing(scale_h, k, max(k_x.std, k_y.std), ck, std))
    return max(found, key=lambda each: each.power, default=None)


def _mean(each: Sequence[_Bearing]) -> _Bearing:
    """Return the mean changes of bearings over the same time scale."""
    n = len(each)
    return replace(
        each[0],
        k=(sum(one.k[0] for one in each) / n, sum(one.k[1] for one in each) / n),
        ck=sum(one.ck for one in each) / n,
        ck_std=math.hypot(*(one.ck_std for one in each)) / n,
    )


def line_finding(
    direction: str, response: ShaftResponse | None, readings: UnitReadings
) -> LineFinding:
    """Return the finding on the transducers of a direction, by the learned line of the shaft."""
    line = next((x for x in response.lines if x.direction == direction), None) if response else None
    if line is None or response is None or readings.motion_um.size == 0:
        return LineFinding()
    rows = [response.places.index((bearing, direction)) for bearing in line.bearings]
    angle = np.radians(readings.attitude_deg[rows])
    outward = np.cos(angle if direction == "x" else angle - np.pi / 2.0) ** 2
    shaft, motion = readings.motion_um[:, rows]
    return line.judge(shaft, motion, readings.deviation[rows], readings.rise[rows] * outward)


def cause_by_damping(
    film: FilmDirection,
    found: Attribution,
    evidence: Evidence,
    lines: Mapping[str, LineFinding],
) -> Attribution:
    """Return the cause of a change that c/k indicates, or `found` if it indicates none.

    Parameters
    ----------
    film, found
        Bearing id and direction of the changed film, and cause found from the shaft motion.
    evidence
        Mean deviations of all films. Bearings without c/k in x and y do not count.
    lines
        Findings on the transducers from the line of the shaft, by direction.
    """
    for direction, line in lines.items():
        if line.bearing == film[0]:
            why = f"gain of the {line.verdict} of {film[0]} in {direction}: {line.words}"
            return replace(found, cause=Cause.TRANSDUCER, reason=why)
    own = _bearing(evidence, film[0])
    if own is None:
        return found
    bearings = {bearing for bearing, _ in evidence} - {film[0]}
    others = [_bearing(evidence, bearing, own.time_scale_h) for bearing in bearings]
    known = [each for each in others if each is not None]
    has_company = len(known) == len(bearings) > 0 and all(each.follows(own) for each in known)
    if has_company:
        own = _mean([own, *known])
    holds = bool(lines) and all(line.verdict is LineVerdict.HOLDS for line in lines.values())
    cause, why = _cause(own, found, has_company, holds)
    if cause is None:
        return found
    words = [f"{why}: {own.words}", *(line.words for line in lines.values() if holds)]
    return replace(found, cause=cause, reason=", ".join(words))


def _cause(
    own: _Bearing, found: Attribution, has_company: bool, holds: bool
) -> tuple[Cause | None, str]:
    """Return cause and reason; None if c/k does not tell. The line of the shaft may hold."""
    if own.is_moved and found.reason != PROBE_REASON:
        more = "more clearance, or wear" if own.ck > 0.0 else "less clearance"
        return Cause.CLEARANCE, f"c/k changed as by {more}"
    is_bracket = holds and found.cause is Cause.BRACKET_OR_TRANSDUCER and not has_company
    if is_bracket and own.is_alike and own.mean_k > 0.0:
        return Cause.BRACKET, "shaft motion agrees with a changed bracket, and no gain changed"
    if not (own.is_unmoved and own.is_alike):
        return None, ""
    if has_company:
        return Cause.OIL, "k of all bearings changed alike, and c/k did not"
    # oil of one bearing does not thicken without being changed, which needs a new baseline
    if own.mean_k < 0.0 and (holds or found.cause is Cause.FILM):
        return Cause.OIL, "k of this bearing changed, and c/k did not"
    if holds:
        return Cause.BRACKET, "k rose in x and y alike, and c/k did not"
    return None, ""
