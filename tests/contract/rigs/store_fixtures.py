"""What is written to a store, and what is asked of it; types of the fixtures for that."""

from collections.abc import Callable

from core.monitor.assessment import Assessment
from core.samples.gaps import Gap
from service.store.port import TrendQuery, UnitGap

Build = Callable[..., Assessment]

T0 = 1_767_225_600_000_000_000
HOP_NS = 11_946_666_667


def at(refresh: int) -> int:
    """Time of a refresh."""
    return T0 + refresh * HOP_NS


def gap(stop_ns: int = T0, unit: str = "U1", first_index: int = 100) -> UnitGap:
    """A recorded gap."""
    return UnitGap(unit, Gap(3, first_index, 50, stop_ns))


def query(*quantities: str, **changes: object) -> TrendQuery:
    """A query; by default for everything there is about one bearing."""
    arguments: dict[str, object] = {
        "unit": "U1",
        "bearing": "UJB",
        "quantities": quantities or ("speed_rpm",),
        "start_ns": T0 - 10 * HOP_NS,
        "end_ns": T0 + 10_000_000 * HOP_NS,
        "max_points": 5000,
        "hole_ns": 1 << 62,
    }
    return TrendQuery(**{**arguments, **changes})  # type: ignore[arg-type]
