"""Film coefficients as ratios to the bracket stiffness, for brackets of unknown stiffness.

All estimators are proportional to the bracket stiffness k_b. Where it is unknown, they are computed
with k_b = 1 N/m, so that stiffness is k/k_b and damping is c/k_b in seconds. The ratios can be
monitored in place of absolute coefficients (Brito et al., section 3.3.2).
"""

from collections.abc import Container, Mapping

from core.quality import Reading, Reason, missing

SUFFIXES = {"_n_per_m": "_of_kb", "_n_s_per_m": "_of_kb_s"}
"""Suffixes of the quantities that are proportional to k_b, and of their ratios to k_b."""


def ratio_name(name: str) -> str | None:
    """Return the name of the ratio of a quantity to k_b; None if it is not proportional to k_b."""
    found = [(own, ratio) for own, ratio in SUFFIXES.items() if name.endswith(own)]
    return name.removesuffix(found[0][0]) + found[0][1] if found else None


def absolute_name(name: str) -> str | None:
    """Return the name of the quantity whose ratio to k_b is `name`; None if `name` is no ratio."""
    found = [(own, ratio) for own, ratio in SUFFIXES.items() if name.endswith(ratio)]
    return name.removesuffix(found[0][1]) + found[0][0] if found else None


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
