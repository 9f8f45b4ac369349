"""What the polls of a rack say of one bearing at one order line."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from core.arrays import ComplexArray
from core.checks.sensor_checks import axes_quality, backward_share
from core.machine.unit import Bearing
from core.quality import GOOD, Quality, Reading, Reason, missing, worst
from core.spectra.cross_spectrum import (
    BEARING_X,
    BEARING_Y,
    SHAFT_X,
    SHAFT_Y,
    CrossSpectrum,
    average,
)
from core.spectra.segments import ORDER1
from core.spectra.vortex import roundness
from core.stiffness.channel_budget import amplitude_budget, amplitude_lines, roundness_budget
from core.stiffness.evidence import EvidenceSettings, LineLimits, line_excitation
from core.stiffness.line_results import AMPLITUDES, DIRECTIONS, PHASES, Vectors, phase_readings
from core.stiffness.ratio import effective_stiffness_n_per_m
from core.stiffness.stiffness_budget import transfer_budgets
from core.stiffness.transfer import line_transfer
from core.stiffness.vector_budget import n_effective, n_independent, vector_ratio_budget
from core.uncertainty import Budget, reading_of, with_budgets


@dataclass(frozen=True)
class VectorLine:
    """An order line of one bearing over some polls.

    Parameters
    ----------
    line
        1× or the vortex.
    frequency_hz
        Mean over the polls.
    phasors_um_pk
        (n_polls, 4); real where the phase is not known.
    usable, has_phase : (n_polls, 4)
    min_polls
        Independent polls below which there is no `transfer`.
    quality
        Of what is read from some channels; without a number, why.
    floors_um_pk
        Of (u_x, u_y, v_x, v_y): what a line of each transducer's own noise looks like.
    """

    bearing: Bearing
    settings: EvidenceSettings
    line: int
    frequency_hz: float
    phasors_um_pk: ComplexArray
    usable: npt.NDArray[np.bool_]
    has_phase: npt.NDArray[np.bool_]
    min_polls: int
    quality: Callable[..., Quality | Reading]
    floors_um_pk: tuple[float, ...]

    @property
    def spectrum(self) -> CrossSpectrum:
        """Averages over the polls, at this one line."""
        return average(
            np.array([self.frequency_hz]), self.phasors_um_pk[:, :, np.newaxis], self.usable
        )

    @property
    def phases_known(self) -> bool:
        """Whether the phase of all four channels is known in any poll."""
        return bool((self.usable & self.has_phase).all(axis=1).any())

    def amplitudes(self) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
        """Amplitude of each channel and its budget, by quantity."""
        spectrum = self.spectrum
        readings: dict[str, Reading] = {}
        found: dict[str, Budget | None] = {}
        for name, place in AMPLITUDES.items():
            quality = self.quality(self.line, place)
            amplitude = float(spectrum.amplitude_um_pk(place)[0])
            readings[f"{name}_um_pk"] = (
                quality if isinstance(quality, Reading) else Reading(amplitude, quality)
            )
            counted = self.phasors_um_pk[self.usable[:, place], place]
            lines = amplitude_lines(self.bearing, place, amplitude, self._runout_um_pk())
            found[f"{name}_um_pk"] = amplitude_budget(amplitude, counted, lines)
        return with_budgets(readings, found)

    def phases(self) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
        """Phase of each channel's mean vector to the rack's key-phase, by quantity, at 1×."""
        return phase_readings({name: self._vectors(place) for name, place in PHASES.items()})

    def _vectors(self, place: int) -> Vectors:
        quality = self.quality(self.line, place)
        counted = self.usable[:, place] & self.has_phase[:, place]
        if not isinstance(quality, Reading) and not counted[-1]:
            quality = missing(Reason.NOT_MEASURED)
        runout_um_pk = self._runout_um_pk() if place in (SHAFT_X, SHAFT_Y) else 0.0
        return Vectors(self.phasors_um_pk[counted, place], quality, runout_um_pk)

    def roundness(self) -> tuple[Reading, Budget | None]:
        """How round the shaft's orbit is, where the phases of both probes are known."""
        quality = self.quality(self.line, SHAFT_X, SHAFT_Y)
        if isinstance(quality, Reading):
            return quality, None
        phased, shafts = self._phased(SHAFT_X, SHAFT_Y), [SHAFT_X, SHAFT_Y]
        if phased is None:
            return missing(Reason.NOT_MEASURED), None
        found = roundness(phased, 0)
        known = (self.usable & self.has_phase)[:, shafts].all(axis=1)
        counted, runout_um_pk = self.phasors_um_pk[known][:, shafts], self._runout_um_pk()
        budget = roundness_budget(self.bearing, found, counted, (runout_um_pk, runout_um_pk))
        return Reading(found, quality), budget

    def axes_quality(self, rotation_sense: int) -> Quality:
        """Whether shaft and bearing whirl with the rotation, where that can be told."""
        return worst(
            self._pair_quality(x, y, rotation_sense)
            for x, y in ((SHAFT_X, SHAFT_Y), (BEARING_X, BEARING_Y))
        )

    def _pair_quality(self, x: int, y: int, rotation_sense: int) -> Quality:
        phased = self._phased(x, y)
        # runout is as round as the shaft's orbit, and turns as it does or against it
        runout_um_pk = self._runout_um_pk() if x == SHAFT_X else 0.0
        least_um_pk = max(self.floors_um_pk[x], self.floors_um_pk[y], runout_um_pk)
        if phased is None or not (
            min(phased.power[0, x, y], phased.power[0, y, x]) > least_um_pk**2
        ):
            return GOOD
        power, cross = phased.power[0], complex(phased.matrix[0, x, y])
        share = backward_share(float(power[x, y]), float(power[y, x]), cross)
        return axes_quality(share, rotation_sense, self.settings.sensors)

    def stiffness(self) -> tuple[dict[str, Reading], Mapping[str, Budget]]:
        """Equation (5) and, with phases, transfer in both directions, and their budgets."""
        readings: dict[str, Reading] = {}
        budgets: dict[str, Budget] = {}
        for axes, (shaft, bearing) in DIRECTIONS.items():
            readings[f"coherence_{axes}"] = missing(Reason.NOT_MEASURED)
            quality = self.quality(self.line, shaft, bearing)
            if not isinstance(quality, Reading):
                reason = self._why_silent(shaft, bearing)
                quality = quality if reason is Reason.OK else missing(reason)
            readings[f"k_eff_{axes}_n_per_m"] = (
                quality
                if isinstance(quality, Reading)
                else self._ratio(axes, shaft, bearing, quality, budgets)
            )
            transfer = (
                (quality, quality)
                if isinstance(quality, Reading)
                else self._transfer(axes, shaft, bearing, quality, budgets)
            )
            names = (f"transfer_k_{axes}_n_per_m", f"transfer_c_{axes}_n_s_per_m")
            readings |= dict(zip(names, transfer, strict=True))
        return readings, budgets

    def _phased(self, first: int, second: int) -> CrossSpectrum | None:
        """Averages over the polls in which two channels have a phase; None if there are none."""
        known = self.usable & self.has_phase
        if not known[:, [first, second]].all(axis=1).any():
            return None
        return average(np.array([self.frequency_hz]), self.phasors_um_pk[:, :, np.newaxis], known)

    def _runout_um_pk(self) -> float:
        return self.bearing.runout_um_pk if self.line == ORDER1 else 0.0

    def _why_silent(self, shaft: int, bearing: int) -> Reason:
        """Why no stiffness may be read from the line; OK if one may."""
        spectrum, quiet = self.spectrum, Reason.INSUFFICIENT_EXCITATION
        if not spectrum.n_segments[shaft, bearing] or spectrum.power[0, shaft, bearing] <= 0.0:
            return quiet
        if spectrum.amplitude_um_pk(bearing)[0] < self.floors_um_pk[bearing]:
            return quiet
        limits = LineLimits(0.0, self._runout_um_pk())
        reason = line_excitation(spectrum, 0, shaft, bearing, limits)
        phased = self._phased(shaft, bearing)
        if reason is Reason.OK and phased is not None:  # vectors that do not hang together
            limits = LineLimits(self.settings.min_coherence, self._runout_um_pk())
            reason = line_excitation(phased, 0, shaft, bearing, limits)
        return Reason.OK if reason is Reason.FEW_SEGMENTS else reason

    def _ratio(
        self, axes: str, shaft: int, bearing: int, quality: Quality, budgets: dict[str, Budget]
    ) -> Reading:
        ratio = float(self.spectrum.amplitude_ratio(bearing, shaft)[0])
        k_eff = effective_stiffness_n_per_m(ratio, 1.0, self.bearing.bracket_stiffness_n_per_m)
        phased = self._phased(shaft, bearing)
        u, v = self._common(shaft, bearing)
        budget = vector_ratio_budget(
            u,
            v,
            self.frequency_hz,
            self.bearing.bracket,
            self.bearing.accuracy,
            max(
                self.settings.min_coherence,
                0.0 if phased is None else float(phased.coherence(shaft, bearing)[0]),
            ),
            self._runout_um_pk(),
            self._across(shaft),
        )
        if budget is None:
            return Reading(k_eff, quality)
        budgets[f"k_eff_{axes}_n_per_m"] = budget
        return reading_of(budget, quality)

    def _across(self, shaft: int) -> float:
        """Shaft motion across a direction per motion along it; 1 where that is not known."""
        power = self.spectrum.power[0]
        across = SHAFT_Y if shaft == SHAFT_X else SHAFT_X
        along, beside = float(power[shaft, across]), float(power[across, shaft])
        return (beside / along) ** 0.5 if along > 0.0 else 1.0

    def _transfer(
        self, axes: str, shaft: int, bearing: int, quality: Quality, budgets: dict[str, Budget]
    ) -> tuple[Reading, Reading]:
        phased = self._phased(shaft, bearing)
        if phased is None:
            nothing = missing(Reason.NOT_MEASURED)
            return nothing, nothing
        common = self._common(shaft, bearing)
        found = line_transfer(phased, 0, shaft, bearing, self.bearing.bracket, n_effective(*common))
        if n_independent(*common) < self.min_polls or found is None:
            few = missing(Reason.FEW_SEGMENTS)
            return few, few
        of_k, of_c = transfer_budgets(
            found, self.bearing.bracket, self.bearing.accuracy, self._runout_um_pk()
        )
        budgets[f"transfer_k_{axes}_n_per_m"] = of_k
        budgets[f"transfer_c_{axes}_n_s_per_m"] = of_c
        return reading_of(of_k, quality), reading_of(of_c, quality)

    def _common(
        self, shaft: int, bearing: int
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Amplitudes of both in the polls in which both are usable and the shaft moves."""
        amplitudes = np.abs(self.phasors_um_pk)
        both = self.usable[:, shaft] & self.usable[:, bearing] & (amplitudes[:, shaft] > 0.0)
        return amplitudes[both, shaft], amplitudes[both, bearing]
