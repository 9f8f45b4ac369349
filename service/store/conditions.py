"""Parts of statements that choose readings by condition, where NULL asks for nothing."""

from collections.abc import Iterable

from core.condition.operating_state import OperatingState
from service.store.value_range import ValueRange

IN_STATES = """(
        CAST(:states AS TEXT) = '' OR CAST(:states AS TEXT) LIKE '%,' || operating_state || ',%'
    )"""
"""Whether an operating state is among those listed as ``,2,3,``; an empty list asks for nothing."""


def at_least(column: str, name: str) -> str:
    """Whether a column reaches a parameter."""
    return f"(CAST(:{name} AS DOUBLE PRECISION) IS NULL OR {column} >= :{name})"


def at_most(column: str, name: str) -> str:
    """Whether a column does not exceed a parameter."""
    return f"(CAST(:{name} AS DOUBLE PRECISION) IS NULL OR {column} <= :{name})"


BETWEEN_BOUNDS = f"""{at_least("eccentricity_ratio", "eccentricity_low")}
    AND {at_most("eccentricity_ratio", "eccentricity_high")}
    AND {at_least("oil_temperature_c", "oil_low")}
    AND {at_most("oil_temperature_c", "oil_high")}"""
"""Whether a single reading lies within the bounds that are asked for."""


def condition_arguments(
    states: Iterable[OperatingState], eccentricity_ratio: ValueRange, oil_temperature_c: ValueRange
) -> dict[str, object]:
    """Parameters of `IN_STATES` and `BETWEEN_BOUNDS`."""
    return {
        "eccentricity_low": eccentricity_ratio.low,
        "eccentricity_high": eccentricity_ratio.high,
        "oil_low": oil_temperature_c.low,
        "oil_high": oil_temperature_c.high,
        "states": "".join(f",{int(state)}," for state in states),
    }
