"""The estimators of film stiffness: one table, the check of their signs, and the choice of one."""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from core.machine.unit import Estimator
from core.quality import Reading, Reason, missing, worst


@dataclass(frozen=True)
class EstimatorEntry:
    """What an estimator reports of a direction, as names of quantities with "xx" or "yy" for axes.

    Parameters
    ----------
    label
        Words for people.
    stiffness, damping, coherence
        Names with a place for ``{axes}``; `axis` in that of the coherence is "x" or "y". Equation
        (5) cannot tell stiffness from damping.
    """

    label: str
    stiffness: str
    damping: str | None
    coherence: str

    def names(self, axes: str) -> tuple[str, ...]:
        """Stiffness and, where there is one, damping of a direction."""
        return tuple(
            name.format(axes=axes) for name in (self.stiffness, self.damping) if name is not None
        )


LINES = {"order1": "1×", "vortex": "vortex"}

ESTIMATORS: Mapping[Estimator, EstimatorEntry] = {
    Estimator.DYNAMIC: EstimatorEntry(
        "dynamic",
        "dynamic_k_{axes}_n_per_m",
        "dynamic_c_{axes}_n_s_per_m",
        "dynamic_coherence_{axis}",
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
"""`transfer` by the line that it is read from."""

DYNAMIC_COEFFICIENTS = tuple(
    tuple(
        f"dynamic_{letter}_{row}{column}_{unit}"
        for letter, unit in (("k", "n_per_m"), ("c", "n_s_per_m"))
        for column in "xy"
    )
    for row in "xy"
)
"""Quantities of `dynamic`, (2, 4) as in `core.stiffness.dynamic.DynamicStiffness`."""

MODEL_DOUBTS = frozenset({Reason.POOR_FIT, Reason.CHANNEL_DELAY, Reason.ESTIMATORS_DISAGREE})
"""Why a number with little scatter may be wrong."""


def preferred_stiffness(
    readings: Mapping[str, Reading], preference: Sequence[Estimator], axes: str
) -> tuple[Reading, Estimator | None]:
    """Take the first estimator in order of preference that is good, else the first with a number.

    A number of few segments is no stiffness yet: a single segment makes any noise coherent. One
    that stands in for another whose model does not hold is uncertain for the same reason: what
    spoils the one may reach the other.

    Parameters
    ----------
    axes
        "xx" or "yy".

    Returns
    -------
    Without any number: why the first choice that was measured has none, and no estimator.
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
        return replace(reading, quality=worst((reading.quality, *doubts))), estimator
    return missing(found[0][0].quality.reason), None


def signs_checked(readings: Mapping[str, Reading]) -> dict[str, Reading]:
    """Replace numbers of a reversed sign by the reason `polarity`.

    Direct stiffness and damping of a film are positive. With one transducer of a direction
    reversed, the ratio of bearing to shaft motion changes its sign, and both come out negative.
    Amplitudes, and with them equation (5), are not affected.

    A negative direct coefficient of `dynamic` takes out all coefficients of its direction, as it is
    not known whether the shaft or the bearing transducer is reversed. A negative stiffness of
    `transfer` takes out its damping, but not the other way round: cross-coupling alone can make the
    damping that a single line shows negative.

    Parameters
    ----------
    readings
        By quantity.
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
    """Whether a transducer of a direction is reversed, by the best estimator that has a result.

    Parameters
    ----------
    readings
        From :func:`signs_checked`.
    axes
        "xx" or "yy".

    Returns
    -------
    None if no estimator has a result.
    """
    for estimator in (Estimator.DYNAMIC, Estimator.TRANSFER_VORTEX, Estimator.TRANSFER_ORDER1):
        reading = readings.get(ESTIMATORS[estimator].stiffness.format(axes=axes))
        if reading is not None and reading.quality.reason is Reason.POLARITY:
            return True
        if reading is not None and reading.value is not None:
            return False
    return None


def _is_negative(reading: Reading) -> bool:
    """Whether a value is below zero by more than its uncertainty."""
    if reading.value is None:
        return False
    return (reading.value if reading.interval_95 is None else reading.interval_95[1]) < 0.0


def _take_out(readings: dict[str, Reading], names: tuple[str, ...]) -> None:
    for name in names:
        if readings[name].value is not None:
            readings[name] = missing(Reason.POLARITY)
