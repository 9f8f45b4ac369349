"""From a simulated unit's counts to averaged spectra, for the accuracy benchmark and its tests.

Simulator, converter, calibration, ring and segments are the real ones. Pieces stream through, so
that an hour takes no more memory than a minute.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from acquisition.simulated.plant.films import Film
from acquisition.simulated.plant.plant import CHUNK_SAMPLES
from acquisition.simulated.plant.rotor import (
    ForcePlane,
    RotorParameters,
    bearing_response,
    forward_force,
    rotor_matrices,
    unbalance_force_n,
)
from acquisition.simulated.plant.scenario import ChannelScenario, Scenario, TransducerNoise
from acquisition.simulated.plant.unit import SimulatedUnit
from benchmarks.flexible_rotor import (
    BRACKETS,
    FREQUENCY_HZ,
    TURN_HZ,
    recording,
    tilting_films,
)
from core.arrays import FloatArray
from core.machine.channel import Channel, Measurand
from core.machine.response import Response
from core.machine.unit import Bearing, BracketDynamics, Unit
from core.monitor.assessment import AnalysisSettings
from core.samples.blocks import SampleBlock
from core.samples.calibration import ChannelCalibration, SlowCalibration, UnitCalibration
from core.samples.ring import Ring
from core.spectra.cross_spectrum import NO_SPECTRUM, CrossSpectrum, average
from core.spectra.segments import SegmentTransform
from core.units import rad_s_from_rpm

RATE_HZ = 600.0
START_NS = 1_790_000_000_000_000_000
PROBE = ChannelCalibration(full_scale_v=20.0, unit_per_v=-250.0, ok_min_v=-18.0, ok_max_v=-2.0)
BEARING_CHANNEL = {
    Measurand.ACCELERATION_M_S2: ChannelCalibration(10.0, 0.05, -10.0, 10.0),
    Measurand.VELOCITY_MM_S: ChannelCalibration(10.0, 0.1, -10.0, 10.0),
}
"""Full scale of 0.5 m/s² and 1 mm/s, ten times what the machine does."""


@dataclass(frozen=True)
class Transducers:
    """What the measurement adds to the motion.

    Parameters
    ----------
    probe_um_rms
        White, over the whole band.
    accelerometer_ug_per_rthz
        Noise density above 2 Hz; below, its power grows as 1/f.
    runout_um_pk
        At 1×, 2×, 3× ... of the running speed, with phases drawn for each run.
    response
        Of the bearing channels.
    gain_half_width
        Limits within which the gain of every channel is drawn.
    blind
        Channels that show their noise alone.
    """

    probe_um_rms: float = 0.0
    accelerometer_ug_per_rthz: float = 0.0
    runout_um_pk: tuple[float, ...] = ()
    response: Response | None = None
    gain_half_width: float = 0.0
    blind: tuple[str, ...] = ()


IDEAL = Transducers()
REALISTIC = Transducers(
    probe_um_rms=1.2,
    accelerometer_ug_per_rthz=5.0,
    runout_um_pk=(10.0, 3.0, 1.5, 1.0, 0.7, 0.5, 0.4, 0.3),
)


@dataclass(frozen=True)
class Run:
    """One simulated recording.

    Parameters
    ----------
    bracket_half_width
        Limits within which the true stiffness of the brackets is drawn.
    speed_rpm
        Limits within which the speed is drawn, where it is not the scenario's.
    """

    scenario: Scenario
    transducers: Transducers = IDEAL
    bearing_measurand: Measurand = Measurand.ACCELERATION_M_S2
    duration_s: float = 300.0
    bracket_half_width: float = 0.0
    speed_rpm: tuple[float, float] | None = None


@dataclass(frozen=True)
class FlexibleRun:
    """Spectra of tilting pads under a flexible rotor (`benchmarks.flexible_rotor`)."""

    eccentricity: float
    bends_at_hz: float
    n_segments: int = 140


@dataclass(frozen=True)
class BearingSpectra:
    """What the estimators get, and the truth beside it.

    Parameters
    ----------
    bins
        At the lines of the segments.
    orders
        At exactly 1× and the vortex.
    film
        Constant coefficients of the film at the running speed.
    n_integrations
        From the measurands of v_x and v_y to displacement.
    order1_um_pk
        (4,) true amplitudes at 1×, by unbalance alone.
    """

    bins: CrossSpectrum
    orders: CrossSpectrum
    film: Film
    bracket: BracketDynamics
    turn_hz: tuple[float, float]
    n_integrations: tuple[int, int]
    order1_um_pk: FloatArray


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
    unit = machine(run.bearing_measurand, response)
    scenario = drawn(run, unit, np.random.default_rng(seed))
    n_chunks = int(run.duration_s * RATE_HZ) // CHUNK_SAMPLES
    settings = AnalysisSettings(n_segments=n_chunks)  # more than there can be: all are averaged
    transform = _transform(unit, settings, _blocks(unit, scenario, seed, n_chunks))
    return {b.id: _of_bearing(unit, b, scenario, transform) for b in unit.bearings}


def flexible_spectra(run: FlexibleRun, seed: int) -> dict[str, BearingSpectra]:
    """Draw the spectra of a flexible rotor between the harmonics, by bearing; no lines at 1×."""
    films, found = tilting_films(run.eccentricity), {}
    turn_hz = np.array([TURN_HZ])
    for place, (name, film) in enumerate(films.items()):
        own_seed = len(films) * seed + place
        phasors = recording(name, run.eccentricity, own_seed, run.n_segments, run.bends_at_hz)
        found[name] = BearingSpectra(
            bins=average(FREQUENCY_HZ, phasors, np.ones(phasors.shape[:2], dtype=np.bool_)),
            orders=replace(NO_SPECTRUM, frequency_hz=turn_hz),
            film=film.at(2.0 * np.pi * TURN_HZ),
            bracket=BRACKETS[name],
            turn_hz=(TURN_HZ, TURN_HZ),
            n_integrations=(0, 0),
            order1_um_pk=np.zeros(4),
        )
    return found


def drawn(run: Run, unit: Unit, draws: np.random.Generator) -> Scenario:
    """Draw gains, brackets, speed and the phases of runout for one run."""

    def within(half_width: float) -> float:
        return float(1.0 + half_width * draws.uniform(-1.0, 1.0))

    scenario, transducers = run.scenario, run.transducers
    bearings = {
        name: replace(
            bearing,
            bracket_stiffness_factor=within(run.bracket_half_width),
            runout_um_pk=tuple(
                um_pk * complex(np.exp(2j * np.pi * draws.uniform()))
                for um_pk in transducers.runout_um_pk
            ),
        )
        for name, bearing in scenario.bearings.items()
    }
    low, high = run.speed_rpm or (scenario.speed_rpm, scenario.speed_rpm)
    return replace(
        scenario,
        bearings=bearings,
        speed_rpm=float(draws.uniform(low, high)),
        noise=TransducerNoise(
            gap_um_rms=transducers.probe_um_rms,
            accelerometer_g_per_sqrt_hz=transducers.accelerometer_ug_per_rthz * 1e-6,
        ),
        channels=_channels(unit, transducers, within),
    )


def _channels(
    unit: Unit, transducers: Transducers, within: Callable[[float], float]
) -> Mapping[str, ChannelScenario]:
    return {
        channel.id: ChannelScenario(
            response=None if channel.measurand is Measurand.GAP_UM else transducers.response,
            gain=0.0 if channel.id in transducers.blind else within(transducers.gain_half_width),
        )
        for channel in unit.channels
    }


def _blocks(unit: Unit, scenario: Scenario, seed: int, n_blocks: int) -> Iterator[SampleBlock]:
    calibration = UnitCalibration(
        unit.id,
        unit.rate_hz,
        tuple(
            PROBE if c.measurand is Measurand.GAP_UM else BEARING_CHANNEL[c.measurand]
            for c in unit.channels
        ),
        (SlowCalibration("speed", 0.0, 1000.0),),
    )
    simulated = SimulatedUnit(unit, calibration, scenario, seed, START_NS)
    for _ in range(n_blocks):
        yield simulated.advance(CHUNK_SAMPLES)


def _transform(
    unit: Unit, settings: AnalysisSettings, blocks: Iterator[SampleBlock]
) -> SegmentTransform:
    transform = SegmentTransform(unit, settings)
    ring = Ring(2 * settings.segment_samples)
    start = 0
    for block in blocks:
        ring.write(block)
        while ring.holds(start, start + settings.segment_samples):
            transform.add(ring.read(start, start + settings.segment_samples))
            start += settings.hop_samples
    return transform


def _of_bearing(
    unit: Unit, bearing: Bearing, scenario: Scenario, transform: SegmentTransform
) -> BearingSpectra:
    ids = [channel.id for channel in unit.channels]
    rows = [ids.index(id_) for id_ in bearing.channels]
    segments = list(transform.segments)
    usable = np.array([s.usable[rows] for s in segments])
    orders_hz = np.array([s.order_frequency_hz for s in segments])
    bins = np.array([s.bin_phasors_um_pk[rows] for s in segments])
    orders = np.array([s.order_phasors_um_pk[rows] for s in segments])
    model = next(b for b in RotorParameters().brackets if b.bearing == bearing.id)
    return BearingSpectra(
        bins=average(transform.frequency_hz, bins, usable),
        orders=average(orders_hz.mean(axis=0), orders, usable),
        film=scenario.bearings[bearing.id].film.at(rad_s_from_rpm(scenario.speed_rpm)),
        bracket=BracketDynamics(bearing.bracket_stiffness_n_per_m, model.mass_kg),
        turn_hz=(float(orders_hz[:, 0].min()), float(orders_hz[:, 0].max())),
        n_integrations=(
            unit.channels[rows[2]].measurand.n_integrations,
            unit.channels[rows[3]].measurand.n_integrations,
        ),
        order1_um_pk=_order1_um_pk(scenario, bearing.id),
    )


def _order1_um_pk(scenario: Scenario, bearing: str) -> FloatArray:
    films = {name: b.film for name, b in scenario.bearings.items()}
    rotor, speed_rpm = scenario.true_rotor, scenario.speed_rpm
    force_n = unbalance_force_n(scenario.unbalance_grade_mm_s, speed_rpm)
    force = forward_force(rotor, ForcePlane.MASS_CENTRE, force_n)
    matrices = rotor_matrices(rotor, films, speed_rpm)
    amplitude: FloatArray = 1e6 * np.abs(
        bearing_response(rotor, matrices, speed_rpm / 60.0, force)[bearing]
    )
    return amplitude
