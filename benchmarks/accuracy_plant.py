"""From a simulated plant to averaged spectra, for the accuracy benchmark and its tests.

The motion is the real simulator's; transducers, their noise and the real ring and segments follow.
Pieces stream through, so that an hour takes no more memory than a minute.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.signal

from acquisition.simulated.plant import CHUNK_SAMPLES, SimulatedPlant
from acquisition.simulated.scenario import Scenario
from core.arrays import FloatArray
from core.blocks import SampleBlock
from core.bracket import BracketDynamics
from core.cross_spectrum import CrossSpectrum, average
from core.film import Film
from core.machine import Bearing, Channel, Measurand, Unit
from core.quality import GOOD, Reading
from core.ring import Ring
from core.rotor_parameters import RotorParameters
from core.segments import SegmentTransform
from core.settings import AnalysisSettings
from core.transducer_response import Response
from core.units import STANDARD_GRAVITY_M_S2, hz_from_rpm, ns_from_s

RATE_HZ = 600.0
PINK_CORNERS_HZ = tuple(0.003 * 10 ** (i / 2) for i in range(11))
"""One-pole noises, two to a decade, whose sum falls as 1/f within 0.3 dB."""


@dataclass(frozen=True)
class Transducers:
    """What the measurement adds to the motion.

    Parameters
    ----------
    probe_um_rms
        White, over the whole band.
    accelerometer_ug_per_rthz, knee_hz
        Noise density far above the knee; its power doubles at the knee and grows as 1/f below.
    runout_um_pk
        At 1×, 2×, 3× ... of the running speed, with phases drawn for each run.
    corner_hz
        First-order high-pass of the bearing channels; none if zero.
    gain_half_width
        Limits within which the gain of every channel is drawn.
    dead
        Channels that show noise alone.
    """

    probe_um_rms: float = 0.0
    accelerometer_ug_per_rthz: float = 0.0
    knee_hz: float = 0.0
    runout_um_pk: tuple[float, ...] = ()
    corner_hz: float = 0.0
    gain_half_width: float = 0.0
    dead: tuple[str, ...] = ()


IDEAL = Transducers()
REALISTIC = Transducers(
    probe_um_rms=1.2,
    accelerometer_ug_per_rthz=5.0,
    knee_hz=2.0,
    runout_um_pk=(10.0, 3.0, 1.5, 1.0, 0.7, 0.5, 0.4, 0.3),
)


@dataclass(frozen=True)
class Run:
    """One simulated recording.

    Parameters
    ----------
    bracket_half_width
        Limits within which the true stiffness of the brackets is drawn.
    """

    scenario: Scenario
    transducers: Transducers = IDEAL
    bearing_measurand: Measurand = Measurand.ACCELERATION_M_S2
    duration_s: float = 300.0
    bracket_half_width: float = 0.0


@dataclass(frozen=True)
class BearingSpectra:
    """What the estimators get, and the truth beside it.

    Parameters
    ----------
    bins
        At the lines of the segments.
    orders
        At exactly 1× and the vortex.
    """

    bins: CrossSpectrum
    orders: CrossSpectrum
    film: Film
    bracket: BracketDynamics
    turn_hz: tuple[float, float]


def machine(bearing_measurand: Measurand, response: Response | None = None) -> Unit:
    """Build the paper's machine with all twelve channels of its Table 3."""
    channels: list[Channel] = []
    bearings = []
    for bracket in RotorParameters().brackets:
        ids = [f"{bracket.bearing}_{what}" for what in ("ux", "uy", "vx", "vy")]
        channels += [Channel(i, Measurand.GAP_UM, direction=-1) for i in ids[:2]]
        channels += [Channel(i, bearing_measurand, response=response) for i in ids[2:]]
        bearings.append(
            Bearing(
                bracket.bearing,
                bracket.stiffness_n_per_m,
                shaft_x=ids[0],
                shaft_y=ids[1],
                bearing_x=ids[2],
                bearing_y=ids[3],
                clearance_um=200.0,
                gap_reference_um=(2000.0, 2000.0),
            )
        )
    return Unit("U1", 92.3, RATE_HZ, tuple(channels), tuple(bearings), "speed")


def spectra(run: Run, seed: int, response: Response | None = None) -> dict[str, BearingSpectra]:
    """Simulate a recording and average it as padwatch does.

    Parameters
    ----------
    response
        What the analysis takes the bearing channels' response to be.

    Returns
    -------
    By bearing.
    """
    draws, noise = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
    nominal = machine(run.bearing_measurand, response)
    scenario = _with_drawn_brackets(run, draws)
    plant = SimulatedPlant(machine(run.bearing_measurand), scenario, seed)
    chain = _Chain(nominal, run.transducers, hz_from_rpm(scenario.speed_rpm), draws, noise)
    n_chunks = int(run.duration_s * RATE_HZ) // CHUNK_SAMPLES
    readings = (chain.read(plant.advance().readings) for _ in range(n_chunks))
    settings = AnalysisSettings(n_segments=n_chunks)  # more than there can be: all are averaged
    transform = _transform(nominal, settings, readings, scenario.speed_rpm)
    return {b.id: _of_bearing(nominal, b, run, transform) for b in nominal.bearings}


class _Chain:
    """Transducers of one run: response, gain, runout, noise, in this order."""

    def __init__(
        self,
        unit: Unit,
        transducers: Transducers,
        turn_hz: float,
        draws: np.random.Generator,
        noise: np.random.Generator,
    ) -> None:
        half = transducers.gain_half_width
        n_channels = len(unit.channels)
        self._transducers, self._turn_hz, self._noise = transducers, turn_hz, noise
        self._gain = 1.0 + half * draws.uniform(-1.0, 1.0, n_channels)
        is_probe = np.array([c.measurand is Measurand.GAP_UM for c in unit.channels])
        self._probes, self._others = np.flatnonzero(is_probe), np.flatnonzero(~is_probe)
        self._alive = np.array([c.id not in transducers.dead for c in unit.channels])
        n_harmonics = len(transducers.runout_um_pk)
        self._phase = draws.uniform(0.0, 2.0 * np.pi, (self._probes.size, n_harmonics))
        self._index = 0
        self._pink = _Pink(self._others.size, transducers, noise)
        self._high_pass = np.zeros((self._others.size, 1))

    def read(self, motion: FloatArray) -> FloatArray:
        """Turn a chunk of motion into readings, in place."""
        n_samples = motion.shape[1]
        if self._transducers.corner_hz:
            b, a = scipy.signal.butter(1, self._transducers.corner_hz, "high", fs=RATE_HZ)
            motion[self._others], self._high_pass = scipy.signal.lfilter(
                b, a, motion[self._others], axis=1, zi=self._high_pass
            )
        motion[self._probes] += self._runout(n_samples)
        motion *= (self._gain * self._alive)[:, np.newaxis]
        shape = (self._probes.size, n_samples)
        motion[self._probes] += self._transducers.probe_um_rms * self._noise.standard_normal(shape)
        motion[self._others] += self._pink.advance(n_samples)
        self._index += n_samples
        return motion

    def _runout(self, n_samples: int) -> FloatArray:
        amplitudes = np.array(self._transducers.runout_um_pk)
        turns = self._turn_hz * np.arange(self._index, self._index + n_samples) / RATE_HZ
        order = np.arange(1, amplitudes.size + 1)
        basis = np.exp(2j * np.pi * np.outer(order, turns))
        runout: FloatArray = ((amplitudes * np.exp(1j * self._phase)) @ basis).real
        return runout


class _Pink:
    """White noise with 1/f below a knee, in the accelerometers' m/s²."""

    def __init__(self, n: int, transducers: Transducers, noise: np.random.Generator) -> None:
        density = transducers.accelerometer_ug_per_rthz * 1e-6 * STANDARD_GRAVITY_M_S2
        self._noise, self._white_rms = noise, density * np.sqrt(RATE_HZ / 2.0)
        # Σ (1/f_i) / (1 + (f/f_i)²) over corners a factor q apart is π / (2 f ln q)
        scale = transducers.knee_hz * 2.0 * np.log(10.0) / 2.0 / np.pi
        self._stages = []
        for corner_hz in PINK_CORNERS_HZ:
            pole = np.exp(-2.0 * np.pi * corner_hz / RATE_HZ)
            rms = self._white_rms * np.sqrt(scale / corner_hz) * (1.0 - pole)
            self._stages.append((pole, rms, np.zeros((n, 1))))
        self._n = n if transducers.knee_hz and density else 0
        self._shape = n

    def advance(self, n_samples: int) -> FloatArray:
        total: FloatArray = self._white_rms * self._noise.standard_normal((self._shape, n_samples))
        if not self._n:
            return total
        stages = []
        for pole, rms, state in self._stages:
            push = rms * self._noise.standard_normal((self._shape, n_samples))
            part, left = scipy.signal.lfilter([1.0], [1.0, -pole], push, axis=1, zi=state)
            total += part
            stages.append((pole, rms, left))
        self._stages = stages
        return total


def _with_drawn_brackets(run: Run, draws: np.random.Generator) -> Scenario:
    half = run.bracket_half_width
    rotor = run.scenario.rotor
    brackets = tuple(
        replace(b, stiffness_n_per_m=b.stiffness_n_per_m * (1.0 + half * draws.uniform(-1.0, 1.0)))
        for b in rotor.brackets
    )
    return replace(run.scenario, rotor=replace(rotor, brackets=brackets))


def _transform(
    unit: Unit, settings: AnalysisSettings, readings: Iterator[FloatArray], speed_rpm: float
) -> SegmentTransform:
    transform, ring = SegmentTransform(unit, settings), Ring(12, 2 * settings.segment_samples)
    start = index = 0
    for chunk in readings:
        ring.write(_block(unit, chunk, index, speed_rpm))
        index += chunk.shape[1]
        while ring.holds(start, start + settings.segment_samples):
            transform.add(ring.read(start, start + settings.segment_samples))
            start += settings.hop_samples
    return transform


def _block(unit: Unit, samples: FloatArray, index: int, speed_rpm: float) -> SampleBlock:
    return SampleBlock(
        unit=unit.id,
        epoch=1,
        first_index=index,
        start_ns=ns_from_s(index / RATE_HZ),
        rate_hz=RATE_HZ,
        samples=samples.astype(np.float32),
        channel_quality=(GOOD,) * len(unit.channels),
        slow={"speed": Reading(speed_rpm)},
    )


def _of_bearing(
    unit: Unit, bearing: Bearing, run: Run, transform: SegmentTransform
) -> BearingSpectra:
    ids = [channel.id for channel in unit.channels]
    rows = [ids.index(id_) for id_ in bearing.channels]
    segments = list(transform.segments)
    usable = np.ones((len(segments), len(rows)), dtype=bool)
    orders_hz = np.array([s.order_frequency_hz for s in segments])
    bins = np.array([s.bin_phasors_um_pk[rows] for s in segments])
    orders = np.array([s.order_phasors_um_pk[rows] for s in segments])
    model = next(b for b in RotorParameters().brackets if b.bearing == bearing.id)
    return BearingSpectra(
        bins=average(transform.frequency_hz, bins, usable),
        orders=average(orders_hz.mean(axis=0), orders, usable),
        film=run.scenario.bearings[bearing.id].film,
        bracket=BracketDynamics(bearing.bracket_stiffness_n_per_m, model.mass_kg),
        turn_hz=(float(orders_hz[:, 0].min()), float(orders_hz[:, 0].max())),
    )
