"""Spellings of units in measurement and DBC files, and conversion to the units of channels."""

import re
from collections.abc import Iterable

from acquisition.errors import ConfigError
from core.machine.channel import Measurand
from core.units import STANDARD_GRAVITY_M_S2

_SAME = {
    "um": ("um", "\u00b5m", "\u03bcm", "micrometer", "micrometre"),
    "mm": ("mm",),
    "m": ("m",),
    "mil": ("mil", "mils"),
    "mm/s": ("mm/s", "mm s-1"),
    "m/s": ("m/s",),
    "in/s": ("in/s", "ips"),
    "m/s2": ("m/s2", "m/s\u00b2", "m/s^2", "m s-2"),
    "g": ("g", "g_n"),
    "V": ("V", "volt", "Volts"),
    "mV": ("mV",),
    "r/min": ("r/min", "rpm", "1/min", "min-1"),
    "Hz": ("Hz",),
    "MW": ("MW",),
    "kW": ("kW",),
    "degC": ("degC", "\u00b0C", "\u2103", "deg C"),
    "K": ("K",),
}
_CANONICAL = {spelling: unit for unit, spellings in _SAME.items() for spelling in spellings}

UNIT_OF = {
    Measurand.GAP_UM: "um",
    Measurand.DISPLACEMENT_UM: "um",
    Measurand.VELOCITY_MM_S: "mm/s",
    Measurand.ACCELERATION_M_S2: "m/s2",
    Measurand.KEY_PHASE_V: "V",
}
"""Engineering unit of each measurand of waveform channels, in ASCII."""

_LENGTH_UM = {"um": 1.0, "mm": 1e3, "m": 1e6, "mil": 25.4}
_WAVEFORMS = {
    Measurand.GAP_UM: _LENGTH_UM,
    Measurand.DISPLACEMENT_UM: _LENGTH_UM,
    Measurand.VELOCITY_MM_S: {"mm/s": 1.0, "m/s": 1e3, "in/s": 25.4},
    Measurand.ACCELERATION_M_S2: {"m/s2": 1.0, "g": STANDARD_GRAVITY_M_S2},
    Measurand.KEY_PHASE_V: {},
}
_VOLTS = {"V": 1.0, "mV": 1e-3}

_SLOW: dict[str, dict[str, tuple[float, float]]] = {
    "r/min": {"r/min": (1.0, 0.0), "Hz": (60.0, 0.0)},
    "MW": {"MW": (1.0, 0.0), "kW": (1e-3, 0.0)},
    "degC": {"degC": (1.0, 0.0), "K": (1.0, -273.15)},
    "mm": {"mm": (1.0, 0.0), "um": (1e-3, 0.0)},
}


def canonical(unit: str) -> str:
    """Return the canonical spelling of a unit; an unknown unit is returned without outer spaces."""
    return _CANONICAL.get(unit.strip(), unit.strip())


def known_unit(spelling: str) -> str | None:
    """Return the canonical unit of a spelling; None if unknown."""
    return _CANONICAL.get(spelling)


def spellings(unit: str) -> str:
    """Return all spellings of a canonical unit, quoted and separated by commas, for a message."""
    return ", ".join(f'"{spelling}"' for spelling in _SAME[unit])


def waveform_factor(measurand: Measurand, unit: str, unit_per_v: float) -> float:
    """Return the factor that converts the unit of a file to the engineering unit of a channel.

    `unit` is the unit in the file, and `unit_per_v` the engineering units of the channel per volt.
    Raises ConfigError if the unit does not belong to the measurand of the channel.
    """
    known = _WAVEFORMS[measurand] | {volt: v * unit_per_v for volt, v in _VOLTS.items()}
    if canonical(unit) not in known:
        raise _misfit(unit, measurand.value, known)
    return known[canonical(unit)]


def slow_conversion(channel_unit: str, unit: str) -> tuple[float, float]:
    """Return factor and offset that convert a file's unit to a slow channel's: factor · x + offset.

    Raises ConfigError if there is no conversion.
    """
    known = _SLOW[channel_unit]
    if canonical(unit) not in known:
        raise _misfit(unit, channel_unit, known)
    return known[canonical(unit)]


def unit_in(heading: str) -> str | None:
    """Return the known unit in brackets at the end of a heading, ``shaft x [um]``; else None."""
    found = re.search(r"\[([^\[\]]{1,16})\]\s*$", heading)
    return found[1] if found and found[1].strip() in _CANONICAL else None


def require_unit(place: object, found: str | None, mapped: str) -> None:
    """Check that a column's unit, if its file states one, equals the unit in the import mapping.

    `place` names the column, `found` is its unit in the file, and `mapped` that in the mapping.
    Raises ConfigError if the units differ; the message states column and units.
    """
    if found and found.strip() and canonical(found) != canonical(mapped):
        raise ConfigError(
            f"column {str(place)[:200]!r} has unit {found[:40]!r}, expected {mapped!r}"
        )


def _misfit(unit: str, wanted: str, known: Iterable[str]) -> ConfigError:
    return ConfigError(
        f"unit {unit[:40]!r} cannot be converted to {wanted}; use one of {', '.join(known)}"
    )
