"""A small unit, and blocks made of known signals."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from scipy.signal import lfilter

from core.arrays import FloatArray
from core.blocks import SampleBlock
from core.machine import Bearing, Channel, Measurand, Unit
from core.quality import GOOD, Reading, Reason, missing
from core.stiffness_history import StiffnessHistory

RATE_HZ = 600.0

BlockMaker = Callable[..., Iterator[SampleBlock]]


@pytest.fixture
def unit() -> Unit:
    channels = (
        Channel("sx", Measurand.GAP_UM, -1),
        Channel("sy", Measurand.GAP_UM, -1),
        Channel("bx", Measurand.DISPLACEMENT_UM),
        Channel("by", Measurand.DISPLACEMENT_UM),
    )
    bearing = Bearing("UJB", 1.18e9, "sx", "sy", "bx", "by", 200.0, (2000.0, 2000.0), "oil")
    return Unit("U1", 92.3, RATE_HZ, channels, (bearing,), "speed", "power")


@pytest.fixture
def blocks() -> BlockMaker:
    """Cut (4, n) signals into blocks of the unit."""

    def cut(
        signals: FloatArray,
        n_each: int = 60,
        first_index: int = 0,
        epoch: int = 1,
        speed_rpm: float | None = 92.3,
    ) -> Iterator[SampleBlock]:
        slow = {"power": Reading(650.0), "oil": Reading(45.0)}
        slow["speed"] = missing(Reason.OUT_OF_RANGE) if speed_rpm is None else Reading(speed_rpm)
        for start in range(0, signals.shape[1], n_each):
            samples = signals[:, start : start + n_each].astype(np.float32)
            yield SampleBlock(
                unit="U1",
                epoch=epoch,
                first_index=first_index + start,
                start_ns=round((first_index + start) / RATE_HZ * 1e9),
                rate_hz=RATE_HZ,
                samples=samples,
                channel_quality=(GOOD,) * 4,
                slow=slow,
            )

    return cut


FilmLife = Callable[..., StiffnessHistory]


@pytest.fixture(scope="session")
def film_life() -> FilmLife:
    """Readings of one bearing: warm-ups, loads, seasons, lasting deviations, noise; not physics."""

    def live(
        seed: int,
        days: int = 120,
        lasting_std: float = 0.01,
        noise_std: float = 0.01,
        change: Callable[[FloatArray], FloatArray] | None = None,
        gain: Callable[[FloatArray], FloatArray] | None = None,
    ) -> StiffnessHistory:
        """Live for some days.

        Parameters
        ----------
        change, gain
            ln of what happens to the film, and to the bearing's transducer, at hours since start.
        """
        random = np.random.default_rng(seed)
        hours = np.arange(144 * days) / 6.0
        runs = (hours % 24 > 6.0) & (hours % 24 < 20.0)
        warmth = 1.0 - np.exp(-np.maximum(hours % 24 - 6.0, 0.0) / 2.0)
        season = 5.0 * np.sin(2.0 * np.pi * hours / 24.0 / 90.0)
        power_mw = np.where(_wander(random, hours, 1.0, 10.0) > 0.0, 300.0, 200.0)
        oil_c = 25.0 + season + 22.0 * warmth + _wander(random, hours, 1.0, 12.0)
        e = 0.35 + 0.1 * (power_mw > 250.0) - 0.05 * warmth
        e += _wander(random, hours, 0.03, 6.0) + _wander(random, hours, 0.02, 200.0)
        film = np.stack([_wander(random, hours, lasting_std, 12.0) for _ in "xy"])
        film += np.log(0.5e9) + 4.0 * (e - 0.4) - 0.02 * (oil_c - 45.0)
        film += 0.0 if change is None else change(hours)
        ln_gain = 0.0 if gain is None else gain(hours)
        shaft = np.log(60.0) + _wander(random, hours, 0.03, 5.0) - 0.7 * (film - np.log(0.5e9))
        bearing = shaft + film - np.log(1.18e9) + ln_gain
        one, pair = np.ones(hours.size), np.ones((2, hours.size))
        columns = {
            "time_ns": np.int64(1_700_000_000_000_000_000)
            + np.arange(hours.size) * 600_000_000_000,
            "speed_rpm": 92.3 * one,
            "power_mw": power_mw,
            "eccentricity_ratio": e + random.normal(0.0, 0.003, hours.size),
            "u_eccentricity": 0.003 * one,
            "attitude_deg": 30.0 * one,
            "oil_temperature_c": oil_c,
            "ln_k": film + ln_gain + random.normal(0.0, noise_std, film.shape),
            "u_random": max(noise_std, 1e-9) * pair,
            "shaft_um_pk": np.exp(shaft),
            "bearing_um_pk": np.exp(bearing),
        }
        return StiffnessHistory(**{name: column[..., runs] for name, column in columns.items()})

    return live


def _wander(
    random: np.random.Generator, hours: FloatArray, std: float, memory_h: float
) -> FloatArray:
    memory = float(np.exp(-(hours[1] - hours[0]) / memory_h))
    fresh = random.standard_normal(hours.size) * std * np.sqrt(1.0 - memory**2)
    return np.asarray(lfilter([1.0], [1.0, -memory], fresh))
