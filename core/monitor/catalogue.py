"""Catalogue of all reported quantities of a bearing: name, unit and label."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

from core.machine.channel import SLOW_QUANTITIES
from core.quality import AXES
from core.stiffness.estimators import absolute_name


@dataclass(frozen=True)
class Quantity:
    """Reported quantity of a bearing.

    Parameters
    ----------
    name
        Name in the API and in the database; ends with unit and detector.
    unit
        Displayed unit, with the detector of amplitudes.
    label
        Short description for the user.
    has_uncertainty
        Whether its readings have a random and a systematic standard uncertainty.
    keeps_uncertainty
        Whether these uncertainties are also stored, for trends.
    """

    name: str
    unit: str
    label: str
    has_uncertainty: bool = False
    keeps_uncertainty: bool = False


LIVE = (True, False)
STORED = (True, True)


def _each(name: str, unit: str, label: str, kept: Iterable[bool] = LIVE) -> tuple[Quantity, ...]:
    """Return one quantity for x and one for y; the axis replaces the braces in name and label."""
    return tuple(Quantity(name.format(axis), unit, label.format(axis), *kept) for axis in "xy")


def _coefficients(
    prefix: str, unit: str, words: str, axes: Iterable[str] = ("xx", "yy")
) -> tuple[Quantity, ...]:
    name = prefix + {"N/m": "_{}_n_per_m", "N·s/m": "_{}_n_s_per_m"}[unit]
    return tuple(Quantity(name.format(a), unit, f"{words}, {a}", *STORED) for a in axes)


def _order_quantities(line: str, of: str) -> tuple[Quantity, ...]:
    roundness = f"Orbit shape, {of} (−1 backward to +1 forward circle)"
    return (
        Quantity(f"{line}_frequency_hz", "Hz", f"Frequency of {of}", *LIVE),
        *_each(line + "_shaft_{}_um_pk", "µm 0-pk", f"Shaft vibration {{}}, {of}"),
        *_each(line + "_bearing_{}_um_pk", "µm 0-pk", f"Bearing vibration {{}}, {of}"),
        Quantity(f"{line}_roundness", "1", roundness, *LIVE),
        *_each(line + "_coherence_{0}{0}", "1", f"Coherence of shaft and bearing {{}}, {of}"),
        *_coefficients(f"{line}_k_eff", "N/m", f"Film stiffness, equation (5) at {of}"),
        *_coefficients(f"{line}_transfer_k", "N/m", f"Film stiffness, transfer at {of}"),
        *_coefficients(f"{line}_transfer_c", "N·s/m", f"Film damping, transfer at {of}"),
    )


CATALOGUE: tuple[Quantity, ...] = (
    *_coefficients("stiffness", "N/m", "Film stiffness"),
    Quantity("speed_rpm", "r/min", "Running speed", *LIVE),
    Quantity("power_mw", "MW", "Active power", *LIVE),
    Quantity("oil_temperature_c", "°C", "Oil temperature", *LIVE),
    *_each("gap_{}_um", "µm", "Mean probe gap {}"),
    *_each("opposite_gap_{}_um", "µm", "Mean gap of the probe opposite {}"),
    Quantity("gap_growth_um", "µm", "Thermal growth of all gaps", *STORED),
    *_each("shaft_centre_{}_um", "µm", "Shaft centre {}", STORED),
    Quantity("eccentricity_ratio", "1", "Eccentricity ratio", *STORED),
    Quantity("attitude_angle_deg", "deg", "Attitude angle", *STORED),
    Quantity("pad_temperature_mean_c", "°C", "Mean pad temperature"),
    Quantity("pad_temperature_excess_k", "K", "Hottest pad above the mean of the pads"),
    Quantity("pad_temperature_vector_k", "K", "First harmonic of the pad temperatures"),
    Quantity("pad_temperature_direction_deg", "deg", "Direction of the first harmonic of the pads"),
    *_order_quantities("order1", "1×"),
    *_each("order1_shaft_{}_phase_deg", "deg", "Phase of shaft vibration {}, 1×"),
    *_each("order1_bearing_{}_phase_deg", "deg", "Phase of bearing vibration {}, 1×"),
    *_each("overall_shaft_{}_um_pp", "µm pk-pk", "Shaft vibration {}, broad-band"),
    Quantity("overall_shaft_um_pk", "µm 0-pk", "Maximum shaft displacement, broad-band", *LIVE),
    *_each("overall_bearing_{}_mm_s_rms", "mm/s rms", "Bearing velocity {}, broad-band"),
    *_order_quantities("vortex", "vortex"),
    *_coefficients("dynamic_k", "N/m", "Film stiffness, broadband estimate", AXES),
    *_coefficients("dynamic_c", "N·s/m", "Film damping, broadband estimate", AXES),
    *(
        Quantity(f"dynamic_ck_{a}_s", "s", f"Film damping over stiffness, {a}", *STORED)
        for a in ("xx", "yy")
    ),
    *_each("dynamic_coherence_{}", "1", "Share of the bearing's motion {} that the film explains"),
    *_each("dynamic_lack_of_fit_{}", "1", "Lack of fit of the film {}, about 1 if it fits", ()),
    Quantity("dynamic_n_lines", "1", "Spectral lines used by the broadband estimate"),
    Quantity(
        "dynamic_delay_s",
        "s",
        "Delay of the bearing channels found by the broadband estimate",
        *LIVE,
    ),
    Quantity("dynamic_bracket_mass_kg", "kg", "Bracket mass, fitted where none is given", *LIVE),
)

BY_NAME = {quantity.name: quantity for quantity in CATALOGUE}

_SLOW = re.compile(rf"({'|'.join(SLOW_QUANTITIES)})(?:_([a-z0-9_]+))?_(c|m|percent|a|v)")


@lru_cache(maxsize=4096)
def quantity_named(name: str) -> Quantity | None:
    """Return the quantity with a name; None if there is none.

    The names are those in `CATALOGUE`, those of slow quantities at any position, and those of the
    ratios of film coefficients to the bracket stiffness.
    """
    if name in BY_NAME:
        return BY_NAME[name]
    if (absolute := BY_NAME.get(absolute_name(name) or "")) is not None:
        unit = "s" if name.endswith("_s") else "1"
        return replace(absolute, name=name, unit=unit, label=f"{absolute.label}, over k_b")
    found = _SLOW.fullmatch(name)
    if found is None or found[3] != SLOW_QUANTITIES[found[1]].suffix:
        return None
    slow, position = SLOW_QUANTITIES[found[1]], (found[2] or "").replace("_", " ")
    return Quantity(name, slow.unit, f"{slow.label} {position}".rstrip(), *LIVE)


def quantity_of(name: str) -> Quantity:
    """Return the quantity with a name; raise `KeyError` if there is none."""
    if (found := quantity_named(name)) is None:
        raise KeyError(name)
    return found
