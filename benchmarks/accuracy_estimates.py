"""All estimators on one bearing's spectra, as relative errors against the truth."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

from benchmarks.accuracy_plant import BearingSpectra
from core.machine.unit import BearingAccuracy
from core.quality import Level, Reason
from core.spectra.cross_spectrum import BEARING_X, BEARING_Y, SHAFT_X, SHAFT_Y
from core.spectra.segments import ORDER1, VORTEX
from core.stiffness.dynamic import FilmSpectrum, films
from core.stiffness.dynamic_lines import DynamicSettings
from core.stiffness.dynamic_readings import dynamic_budgets, fit_quality
from core.stiffness.estimators import DYNAMIC_COEFFICIENTS
from core.stiffness.evidence import line_excitation
from core.stiffness.stiffness_budget import ratio_budget, transfer_budgets
from core.uncertainty import Budget, Kind

LINES = {"1×": ORDER1, "vortex": VORTEX}
AXES = {"xx": (SHAFT_X, BEARING_X), "yy": (SHAFT_Y, BEARING_Y)}


@dataclass(frozen=True)
class Estimate:
    """One number of one estimator in one run.

    Parameters
    ----------
    name
        ``dynamic k_xx``, ``transfer 1× k_yy``, ``ratio vortex k_xx``, ...
    error
        Estimate minus truth over the scale of the comparison; NaN without a result.
    covered, covered_random
        Whether the truth lies in the 95 % interval, and in that of the random part alone.
    std
        Stated random standard uncertainty over the same scale.
    """

    name: str
    error: float
    covered: bool = False
    covered_random: bool = False
    std: float = math.nan


def estimates(
    spectra: BearingSpectra,
    accuracy: BearingAccuracy,
    lines: tuple[str, ...] = ("1×",),
    c_over_k_xx: bool = False,
    runout_um_pk: float = 0.0,
    good_only: bool = False,
) -> list[Estimate]:
    """Evaluate every estimator.

    Parameters
    ----------
    lines
        Where `transfer` and `ratio` are read.
    c_over_k_xx
        Compare ω·c at 1× with k_xx, as cross-coupled damping may be nothing to compare with.
    good_only
        Leave out results of `dynamic` whose fit makes them uncertain.
    """
    found = list(_dynamic(spectra, accuracy, c_over_k_xx, good_only))
    for name in lines:
        found += _at_line(spectra, accuracy, name, runout_um_pk)
    return found


def amplitudes(spectra: BearingSpectra) -> list[Estimate]:
    """Compare the amplitudes at 1× with those of the rotor's frequency response."""
    return [
        Estimate(
            f"amplitude {signal}",
            float(spectra.orders.amplitude_um_pk(channel)[ORDER1] / true - 1.0),
        )
        for channel, (signal, true) in enumerate(
            zip(("u_x", "u_y", "v_x", "v_y"), spectra.order1_um_pk, strict=True)
        )
    ]


def _dynamic(
    spectra: BearingSpectra, accuracy: BearingAccuracy, c_over_k_xx: bool, good_only: bool
) -> Iterator[Estimate]:
    film = spectra.film
    measured = FilmSpectrum(spectra.bins, spectra.bracket, spectra.turn_hz, spectra.n_integrations)
    [result] = films([measured], DynamicSettings())
    budgets = {}
    if not isinstance(result, Reason):
        level = fit_quality(result, BearingAccuracy().delay_s, 0.0).level
        if level is Level.GOOD or not good_only:
            budgets = dynamic_budgets(result, spectra.bracket, accuracy)
    omega = 2.0 * math.pi * float(spectra.orders.frequency_hz[ORDER1])
    for letter, truth in (("k", film.stiffness_n_per_m), ("c", film.damping_n_s_per_m)):
        scale = float(truth[0, 0])
        if letter == "c" and c_over_k_xx:
            scale = film.k_xx_n_per_m / omega
        for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
            name = f"{letter}_{'xy'[row]}{'xy'[column]}"
            quantity = DYNAMIC_COEFFICIENTS[row]["kc".index(letter) * 2 + column]
            true = float(truth[row, column])
            yield _compared(f"dynamic {name}", budgets.get(quantity), true, scale)


def _at_line(
    spectra: BearingSpectra, accuracy: BearingAccuracy, line_name: str, runout_um_pk: float
) -> Iterator[Estimate]:
    line, film = LINES[line_name], spectra.film
    omega = 2.0 * math.pi * float(spectra.orders.frequency_hz[line])
    effective = film.effective_stiffness_n_per_m(omega)
    true = (film.k_xx_n_per_m, film.k_yy_n_per_m)
    for index, (axes, (shaft, bearing)) in enumerate(AXES.items()):
        orders, bracket = spectra.orders, spectra.bracket
        excited = (
            line_excitation(orders, line, shaft, bearing, runout_um_pk=runout_um_pk) is Reason.OK
        )
        at = orders, line, shaft, bearing, bracket, accuracy
        transfer = transfer_budgets(*at) if excited else None
        budget = transfer[0] if transfer else None
        yield _compared(f"transfer {line_name} k_{axes}", budget, true[index], true[0])
        ratio = ratio_budget(*at) if excited else None
        # what equation (5) asks for leaves out the bracket's inertia
        asked = effective[index] * bracket.stiffness_n_per_m
        asked /= float(bracket.dynamic_stiffness_n_per_m(orders.frequency_hz[[line]])[0].real)
        yield _compared(f"ratio {line_name} k_{axes}", ratio, effective[index], true[0], asked)


def _compared(
    name: str, budget: Budget | None, true: float, scale: float, asked: float | None = None
) -> Estimate:
    """Compare with the truth; statistics alone with what the estimator can find on average."""
    if budget is None:
        return Estimate(name, math.nan)
    low, high = budget.interval
    random = tuple(line for line in budget.lines if line.kind is Kind.RANDOM)
    low_random, high_random = Budget(budget.value, random).interval
    return Estimate(
        name=name,
        error=(budget.value - true) / scale,
        covered=low <= true <= high,
        covered_random=low_random <= (true if asked is None else asked) <= high_random,
        std=budget.random / scale,
    )
