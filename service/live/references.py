"""Gap references in force for each bearing."""

import asyncio
from collections.abc import Callable, Iterable
from dataclasses import replace

import structlog

from acquisition.clock import Clock
from core.machine.unit import Bearing, Unit
from service.runtime.heartbeats import UNHEARD, Pulse
from service.runtime.periodic import TroubleLog, periodic
from service.store.port import StoreError
from service.store.references import GapReference
from service.store.store import Store

log = structlog.get_logger()

LOOK_EVERY_S = 2.0


Key = tuple[str, str]
"""Unit id and bearing id."""


def opposite_axes(bearing: Bearing) -> tuple[bool, bool]:
    """Return whether the axis x, and whether the axis y, of a bearing has an opposite probe."""
    return bearing.opposite_x is not None, bearing.opposite_y is not None


def with_reference(bearing: Bearing, reference: GapReference) -> Bearing:
    """Return a bearing with its gap reference replaced by a stored reference.

    If the stored reference has no gaps of opposite probes, those of the plant file remain.
    """
    opposite = reference.opposite_reference_um
    if opposite is None or not any(opposite_axes(bearing)):
        opposite = bearing.opposite_reference_um
    return replace(
        bearing, gap_reference_um=reference.gap_reference_um, opposite_reference_um=opposite
    )


class ReferencesInForce:
    """Gap references in force: the newest stored reference of a bearing, or its plant-file gaps.

    `units` have the gap references of the plant file; `on_change` receives the description of a
    unit whose gap reference has changed.
    """

    def __init__(
        self,
        units: Iterable[Unit],
        store: Store,
        clock: Clock,
        on_change: Callable[[Unit], None] = lambda _: None,
    ) -> None:
        self._units = {unit.id: unit for unit in units}
        self._store, self._clock, self._on_change = store, clock, on_change
        self._bearings: dict[Key, Bearing] = {
            (unit.id, bearing.id): bearing
            for unit in self._units.values()
            for bearing in unit.bearings
        }
        self._in_force: dict[Key, GapReference] = {}
        self._unknown: set[Key] = set()
        self._trouble = TroubleLog("references cannot be read", "references can be read again")

    def of(self, unit: str, bearing: str) -> GapReference | None:
        """Return the stored gap reference in force; None if that of the plant file is in force."""
        return self._in_force.get((unit, bearing))

    def bearing(self, unit: str, bearing: str) -> Bearing:
        """Return the description of a bearing with the gap reference in force."""
        described = self._bearings[unit, bearing]
        reference = self.of(unit, bearing)
        return described if reference is None else with_reference(described, reference)

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Read the stored references periodically, until cancelled; `pulse` gets heartbeats."""
        await periodic(self.look, LOOK_EVERY_S, self._clock, pulse)

    async def look(self) -> None:
        """Read the stored references once; an error leaves the references in force unchanged."""
        with self._trouble.noting(StoreError):
            found = await asyncio.to_thread(self._store.gap_references.in_force)
            for unit in {reference.unit for reference in found if self._take(reference)}:
                bearings = tuple(self.bearing(unit, each.id) for each in self._units[unit].bearings)
                self._on_change(replace(self._units[unit], bearings=bearings))

    def _take(self, reference: GapReference) -> bool:
        """Put a stored reference in force; return whether it was not in force before."""
        unit, bearing = key = reference.unit, reference.bearing
        if key not in self._bearings:
            if key not in self._unknown:
                self._unknown.add(key)
                log.warning(
                    "reference of an unknown bearing is ignored", unit=unit, bearing=bearing
                )
            return False
        if self._in_force.get(key) == reference:
            return False
        self._in_force[key] = reference
        log.info(
            "reference in force",
            unit=unit,
            bearing=bearing,
            gap_reference_um=reference.gap_reference_um,
            author=reference.author,
        )
        return True
