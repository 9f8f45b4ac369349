"""Parts of statements that choose readings by condition, where NULL asks for nothing."""

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
