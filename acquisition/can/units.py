"""Spellings of units as they stand in DBC files; what is not listed is refused, never guessed."""

_SPELLINGS = {
    "um": ("um", "µm", "μm"),  # U+00B5 and U+03BC
    "mm": ("mm",),
    "mm/s": ("mm/s",),
    "m/s2": ("m/s2", "m/s²", "m/s^2"),
    "V": ("V",),
    "mV": ("mV",),
    "r/min": ("r/min", "rpm", "1/min"),
    "MW": ("MW",),
    "degC": ("degC", "°C", "deg C"),
    "counts": ("", "1", "count", "counts"),
}
_UNITS = {spelling: unit for unit, spellings in _SPELLINGS.items() for spelling in spellings}


def known_unit(spelling: str) -> str | None:
    """Unit that a spelling stands for, if it is in the table."""
    return _UNITS.get(spelling)


def spellings(unit: str) -> str:
    """All spellings of a unit, for a message."""
    return ", ".join(f'"{spelling}"' for spelling in _SPELLINGS[unit])
