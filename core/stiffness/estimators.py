"""Table of the stiffness estimators, check of their results' signs, and choice of the best.

All estimators are proportional to the bracket stiffness k_b. Where it is unknown, they are computed
with k_b = 1 N/m, so that stiffness is k/k_b and damping is c/k_b in seconds. The ratios can be
monitored in place of absolute coefficients (Brito et al., section 3.3.2).
"""

import itertools
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace

from core.machine.unit import Estimator
from core.quality import Reading, Reason, missing, uncertain, worst


@dataclass(frozen=True)
class EstimatorEntry:
    """Names of an estimator and of the quantities that it reports for a direction.

    Parameters
    ----------
    label
        Displayed name of the estimator.
    stiffness
        Name with a placeholder ``{axes}`` for "xx" or "yy".
    damping
        Name with the same placeholder; None for equation (5), whose stiffness includes damping.
    coherence
        Name with a placeholder ``{axis}`` for "x" or "y".
    ck
        Name of damping over stiffness, with the same placeholder; None if not reported.
    """

    label: str
    stiffness: str
    damping: str | None
    coherence: str
    ck: str | None = None

    def names(self, axes: str) -> tuple[str, ...]:
        """Return the names of stiffness, damping and their ratio for `axes`, "xx" or "yy"."""
        return tuple(
            name.format(axes=axes) for name in (self.stiffness, self.damping, self.ck) if name
        )


LINES = {"order1": "1×", "vortex": "vortex"}

ESTIMATORS: Mapping[Estimator, EstimatorEntry] = {
    Estimator.DYNAMIC: EstimatorEntry(
        "dynamic",
        "dynamic_k_{axes}_n_per_m",
        "dynamic_c_{axes}_n_s_per_m",
        "dynamic_coherence_{axis}",
        "dynamic_ck_{axes}_s",
    ),
    **{
        Estimator(f"transfer_{line}"): EstimatorEntry(
            f"transfer, {words}",
            f"{line}_transfer_k_{{axes}}_n_per_m",
            f"{line}_transfer_c_{{axes}}_n_s_per_m",
            f"{line}_coherence_{{axis}}{{axis}}",
        )
        for line, words in LINES.items()
    },
    **{
        Estimator(f"ratio_{line}"): EstimatorEntry(
            f"equation (5), {words}",
            f"{line}_k_eff_{{axes}}_n_per_m",
            None,
            f"{line}_coherence_{{axis}}{{axis}}",
        )
        for line, words in LINES.items()
    },
}

TRANSFERS = {line: Estimator(f"transfer_{line}") for line in LINES}
"""`transfer` estimator of each line, by the prefix of the line's quantities."""

DYNAMIC_COEFFICIENTS = tuple(
    tuple(
        f"dynamic_{letter}_{row}{column}_{unit}"
        for letter, unit in (("k", "n_per_m"), ("c", "n_s_per_m"))
        for column in "xy"
    )
    for row in "xy"
)
"""Names of the coefficients of `dynamic`, (2, 4) as in `DynamicStiffness.coefficients`."""

MODEL_DOUBTS = frozenset({Reason.POOR_FIT, Reason.CHANNEL_DELAY, Reason.ESTIMATORS_DISAGREE})
"""Quality reasons which mean that the model of an estimator may be wrong."""


def preferred_stiffness(
    readings: Mapping[str, Reading], preference: Sequence[Estimator], axes: str
) -> tuple[Reading, Estimator | None]:
    """Return the stiffness of the first good estimator by preference, else the first with a value.

    Values with few segments are not used: in a single segment, any noise is coherent. If an earlier
    estimator is not good for one of `MODEL_DOUBTS`, the chosen stiffness gets the same quality,
    because the cause may affect both. A value beside estimators with reason `polarity` is
    uncertain for this reason, also if its estimator uses amplitudes only. `axes` is "xx" or "yy".

    Returns
    -------
    The reading and its estimator. If no estimator has a value, a reading without a value, with the
    reason of the first measured estimator, and None.
    """
    found = [(readings[ESTIMATORS[e].stiffness.format(axes=axes)], e) for e in preference]
    measured = [(r, e) for r, e in found if r.quality.reason is not Reason.NOT_MEASURED]
    found = measured or found
    numbers = [
        (reading, estimator)
        for reading, estimator in found
        if reading.value is not None and reading.quality.reason is not Reason.FEW_SEGMENTS
    ]
    if numbers:
        reading, estimator = min(numbers, key=lambda choice: choice[0].quality.level)
        before = itertools.takewhile(lambda choice: choice[1] is not estimator, numbers)
        doubts = (r.quality for r, _ in before if r.quality.reason in MODEL_DOUBTS)
        has_wrong_sign = any(r.quality.reason is Reason.POLARITY for r, _ in found)
        signs = [uncertain(Reason.POLARITY)] if has_wrong_sign else []
        return replace(reading, quality=worst((*signs, reading.quality, *doubts))), estimator
    return missing(found[0][0].quality.reason), None


def signs_checked(readings: Mapping[str, Reading]) -> dict[str, Reading]:
    """Return the readings, without the values of wrong sign, whose reason is then `polarity`.

    Direct stiffness and damping of a film are positive. If one transducer of a direction is
    reversed, the ratio of bearing to shaft motion changes its sign, and both become negative.
    Amplitudes, and therefore equation (5), are not affected.

    A value counts as negative if its 95 % interval is below zero. A negative direct coefficient of
    the estimator `dynamic` removes all coefficients of its direction, because either the shaft or
    the bearing transducer may be reversed. A negative stiffness of the estimator `transfer`
    removes its damping as well. A negative damping does not remove the stiffness: cross-coupling
    alone can make the damping at a single line negative.
    """
    found, dynamic = dict(readings), ESTIMATORS[Estimator.DYNAMIC]
    for axes, crossed in (("xx", ("xx", "xy", "yx")), ("yy", ("yy", "yx", "xy"))):
        if any(_is_negative(readings[name]) for name in dynamic.names(axes)):
            for other in crossed:
                _take_out(found, dynamic.names(other))
        for estimator in TRANSFERS.values():
            stiffness, damping = ESTIMATORS[estimator].names(axes)
            if _is_negative(readings[stiffness]):
                _take_out(found, (stiffness, damping))
            elif _is_negative(readings[damping]):
                _take_out(found, (damping,))
    return found


def is_reversed(readings: Mapping[str, Reading], axes: str) -> bool | None:
    """Return whether a transducer of a direction is reversed, by the signs of its stiffness.

    The first estimator with a result decides: `dynamic`, then `transfer` of the vortex, then of 1×.
    Return None without a result. `readings` are from :func:`signs_checked`; `axes` is "xx" or "yy".
    """
    for estimator in (Estimator.DYNAMIC, Estimator.TRANSFER_VORTEX, Estimator.TRANSFER_ORDER1):
        name = ESTIMATORS[estimator].stiffness.format(axes=axes)
        reading = readings.get(reported_name(readings, name))
        if reading is not None and reading.quality.reason is Reason.POLARITY:
            return True
        if reading is not None and reading.value is not None:
            return False
    return None


def _is_negative(reading: Reading) -> bool:
    """Return whether a value and its 95 % interval, if known, are below zero."""
    if reading.value is None:
        return False
    return (reading.value if reading.interval_95 is None else reading.interval_95[1]) < 0.0


def _take_out(readings: dict[str, Reading], names: tuple[str, ...]) -> None:
    for name in names:  # cross-coupled coefficients have no ratio
        if name in readings and readings[name].value is not None:
            readings[name] = missing(Reason.POLARITY)


SUFFIXES = {"_n_per_m": "_of_kb", "_n_s_per_m": "_of_kb_s"}
"""Suffixes of the quantities that are proportional to k_b, and of their ratios to k_b."""


def ratio_name(name: str) -> str | None:
    """Return the name of the ratio of a quantity to k_b; None if it is not proportional to k_b."""
    found = (name.removesuffix(own) + to for own, to in SUFFIXES.items() if name.endswith(own))
    return next(found, None)


def absolute_name(name: str) -> str | None:
    """Return the name of the quantity whose ratio to k_b is `name`; None if `name` is no ratio."""
    found = (name.removesuffix(to) + own for own, to in SUFFIXES.items() if name.endswith(to))
    return next(found, None)


def as_ratios(readings: Mapping[str, Reading]) -> dict[str, Reading]:
    """Return readings computed with k_b = 1 N/m, with the names of ratios to k_b.

    The absolute quantities, and the mass of the bracket, are readings without a value.
    """
    unknown = missing(Reason.BRACKET_UNKNOWN)
    found = dict(readings)
    for name, reading in readings.items():
        if (ratio := ratio_name(name)) is not None:
            found |= {name: unknown, ratio: reading}
    return found | {"dynamic_bracket_mass_kg": unknown}


def reported_name(names: Container[str], name: str) -> str:
    """Return the name of the ratio of a quantity to k_b if it is among `names`, else `name`."""
    ratio = ratio_name(name)
    return name if ratio is None or ratio not in names else ratio
