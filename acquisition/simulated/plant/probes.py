"""Proximity probes around a shaft: standing gap and runout."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acquisition.simulated.plant.conditions import Conditions
from acquisition.simulated.plant.scenario import ChannelScenario, Scenario
from core.arrays import ComplexArray, FloatArray
from core.machine.channel import Measurand
from core.machine.unit import Bearing, Unit


@dataclass(frozen=True)
class Probe:
    """One shaft channel: its bearing, its axis (0 is x, 1 is y), its gap with a centred shaft.

    Parameters
    ----------
    opposite
        Whether it stands across the shaft, on the negative axis.
    """

    channel: str
    slow_channel: str | None
    bearing: int
    axis: int
    opposite: bool
    reference_um: float


def probes(machine: Unit) -> Iterator[Probe]:
    """All shaft channels of a unit."""
    for index, bearing in enumerate(machine.bearings):
        yield from _probes(index, bearing)


def _probes(index: int, bearing: Bearing) -> Iterator[Probe]:
    near_um, far_um = bearing.gap_reference_um, bearing.opposite_reference_um
    yield Probe(bearing.shaft_x, bearing.gap_x, index, 0, False, near_um[0])
    yield Probe(bearing.shaft_y, bearing.gap_y, index, 1, False, near_um[1])
    opposite = (
        (bearing.opposite_x, bearing.opposite_gap_x),
        (
            bearing.opposite_y,
            bearing.opposite_gap_y,
        ),
    )
    for axis, (channel, slow_channel) in enumerate(opposite):
        if channel is not None:
            reference_um = (far_um or near_um)[axis]
            yield Probe(channel, slow_channel, index, axis, True, reference_um)


def gap_um(probe: Probe, direction: int, now: Conditions) -> float:
    """Mean gap under a probe whose reading grows with motion in the given direction."""
    place = probe.bearing, probe.axis
    told_um = direction * float(now.centre_um[place] + now.position_error_um[place])
    return probe.reference_um + told_um + float(now.gap_growth_um[probe.bearing])


def reference_gap_um(machine: Unit) -> FloatArray:
    """Reading of every channel with the shaft centred, (n_channels,); else zero."""
    reference_um = {probe.channel: probe.reference_um for probe in probes(machine)}
    return np.array(
        [reference_um[c.id] if c.measurand is Measurand.GAP_UM else 0.0 for c in machine.channels]
    )


def standing_gap_um(machine: Unit, now: Conditions) -> FloatArray:
    """Mean reading of every channel, (n_channels,): the gap of the probes, zero elsewhere."""
    found = {probe.channel: probe for probe in probes(machine)}
    return np.array(
        [
            gap_um(found[c.id], c.direction, now) if c.measurand is Measurand.GAP_UM else 0.0
            for c in machine.channels
        ]
    )


class ShaftRunout:
    """A surface that is not round, turning under the probes of each bearing."""

    def __init__(self, machine: Unit, scenario: Scenario) -> None:
        rows = {channel.id: row for row, channel in enumerate(machine.channels)}
        self._phasors: dict[int, ComplexArray] = {}
        for probe in probes(machine):
            row = rows[probe.channel]
            channel = machine.channels[row]
            runout = scenario.bearings[machine.bearings[probe.bearing].id].runout_um_pk
            own = scenario.channels.get(channel.id, ChannelScenario()).runout_um_pk
            phasors = np.zeros(max(len(runout), len(own)), np.complex128)
            order = np.arange(1, len(runout) + 1)
            passed = np.exp(-0.5j * np.pi * order * (probe.axis + 2 * probe.opposite))
            # a bump towards the probe is a smaller gap, or motion along a near probe's axis
            gap = channel.measurand is Measurand.GAP_UM
            sign = -1 if gap else channel.direction * (-1 if probe.opposite else 1)
            phasors[: len(runout)] += sign * np.array(runout) * passed
            phasors[: len(own)] += channel.direction * np.array(own)
            if phasors.any():
                self._phasors[row] = phasors

    def add_to(self, readings: FloatArray, turns: FloatArray) -> None:
        """Add what the probes see of it, in place; the rest of the channels see nothing."""
        if not self._phasors:
            return
        once = np.exp(2j * np.pi * np.fmod(turns, 1.0))
        for row, phasors in self._phasors.items():
            # Horner: phasors times powers of one turn
            total = np.zeros_like(once)
            for phasor in phasors[::-1]:
                total = (total + phasor) * once
            readings[row] += total.real
