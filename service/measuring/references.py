"""References that people set while the service runs, on their way to the monitors."""

import asyncio
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Protocol

import structlog

from acquisition.clock import Clock
from core.machine.unit import Bearing, Unit
from service.runtime.heartbeats import UNHEARD, Pulse
from service.store.gap_reference import GapReference
from service.store.port import Store, StoreError

log = structlog.get_logger()

LOOK_EVERY_S = 2.0

Key = tuple[str, str]
"""Unit and bearing."""


def opposite_axes(bearing: Bearing) -> tuple[bool, bool]:
    """Whether the gap is also measured across the shaft, in x and in y."""
    return bearing.opposite_x is not None, bearing.opposite_y is not None


def with_reference(bearing: Bearing, reference: GapReference) -> Bearing:
    """The bearing with a stored reference instead of the one in the plant file.

    A reference without gaps of the opposite probes leaves those of the plant file as they are.
    """
    opposite = reference.opposite_reference_um
    if opposite is None or not any(opposite_axes(bearing)):
        opposite = bearing.opposite_reference_um
    return replace(
        bearing,
        gap_reference_um=reference.gap_reference_um,
        opposite_reference_um=opposite,
    )


class Adopter(Protocol):
    """Whatever takes a new description of its unit: a monitor, as a rule."""

    unit: Unit

    def replace_description(self, unit: Unit) -> None:
        """Take a new description of the same unit."""
        ...


class ReferencesInForce:
    """Hands the newest stored references to the monitors, at the start and ever after.

    Parameters
    ----------
    monitors
        By unit; as built from the plant file, whose references hold where none is stored.
    """

    def __init__(self, monitors: Mapping[str, Adopter], store: Store, clock: Clock) -> None:
        self._monitors, self._store, self._clock = monitors, store, clock
        self._bearings: dict[Key, Bearing] = {
            (unit, bearing.id): bearing
            for unit, monitor in monitors.items()
            for bearing in monitor.unit.bearings
        }
        self._in_force: dict[Key, GapReference] = {}
        self._unknown: set[Key] = set()
        self._store_error: str | None = None

    def of(self, unit: str, bearing: str) -> GapReference | None:
        """The stored reference that a bearing is watched with; None for that of the plant file."""
        return self._in_force.get((unit, bearing))

    def bearing(self, unit: str, bearing: str) -> Bearing:
        """The bearing as it is watched now."""
        described = self._bearings[unit, bearing]
        reference = self.of(unit, bearing)
        return described if reference is None else with_reference(described, reference)

    async def run(self, pulse: Pulse = UNHEARD) -> None:
        """Look for new references for ever."""
        while True:
            pulse.beat(LOOK_EVERY_S)
            await self._clock.sleep(LOOK_EVERY_S)
            await self.look()

    async def look(self) -> None:
        """Take over what has been set since the last look; keep what there is if that fails."""
        try:
            found = await asyncio.to_thread(self._store.references)
        except StoreError as error:
            if self._store_error is None:
                log.error("references cannot be read", reason=str(error))
            self._store_error = str(error)
            return
        if self._store_error is not None:
            log.info("references can be read again")
        self._store_error = None
        self._take(found)

    def _take(self, found: Iterable[GapReference]) -> None:
        news = {(r.unit, r.bearing): r for r in found if self._is_news(r)}
        self._in_force |= news
        for unit in {unit for unit, _ in news}:
            monitor = self._monitors[unit]
            monitor.replace_description(self._described(monitor.unit))
        for (unit, bearing), reference in news.items():
            log.info(
                "reference taken over",
                unit=unit,
                bearing=bearing,
                gap_reference_um=reference.gap_reference_um,
                author=reference.author,
            )

    def _is_news(self, reference: GapReference) -> bool:
        key = (reference.unit, reference.bearing)
        if key in self._bearings:
            return self._in_force.get(key) != reference
        if key not in self._unknown:
            self._unknown.add(key)
            log.warning(
                "reference of a bearing that is not there is ignored", unit=key[0], bearing=key[1]
            )
        return False

    def _described(self, unit: Unit) -> Unit:
        return replace(unit, bearings=tuple(self.bearing(unit.id, b.id) for b in unit.bearings))
