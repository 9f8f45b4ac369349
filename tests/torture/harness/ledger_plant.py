"""The plant that the ledger DAQ serves, its samples, and the plant file of a service."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rigs.blocks import cell_block

from core.samples.blocks import SampleBlock
from core.units import NS_PER_S
from harness.truth import BEARINGS, N_CHANNELS, SPEED_RPM, Truth

NOMINAL_HZ = 600.0
"""Load 1: so many samples a second of each of twelve channels of a unit."""

ALERT_UM_PK = 110.0
DEADBAND_UM = 10.0
RECEIVER = "shift"
MAX_RING_REGISTERS = 60_000


@dataclass(frozen=True)
class LedgerPlant:
    """Shape of the plant.

    Parameters
    ----------
    load
        Sampling rate as a multiple of 600 Hz; all units have twelve channels.
    drift_ppm
        How much faster than they say the devices sample.
    segment_samples, n_segments
        Of the analysis. Short ones give many results, and so many transactions, in short time.
    """

    seed: int = 1
    n_units: int = 2
    load: float = 2.0
    segment_samples: int = 1024
    n_segments: int = 2
    drift_ppm: float = 0.0

    @property
    def rate_hz(self) -> float:
        """Samples per second and channel."""
        return self.load * NOMINAL_HZ

    @property
    def slot_samples(self) -> int:
        """A multiple of 12.5 ms, so that every slot begins at a whole microsecond."""
        return round(self.rate_hz / 20.0) if self.load <= 2.0 else round(self.rate_hz / 12.5)

    @property
    def n_slots(self) -> int:
        """As many as there is room for."""
        return MAX_RING_REGISTERS // (12 * self.slot_samples + 40)

    @property
    def hop_samples(self) -> int:
        """From one result to the next."""
        return self.segment_samples - self.segment_samples // 8

    @property
    def refresh_s(self) -> float:
        """The same in seconds."""
        return self.hop_samples / self.rate_hz

    @property
    def units(self) -> tuple[str, ...]:
        """Names of the units."""
        return tuple(f"U{number}" for number in range(1, self.n_units + 1))

    def write(
        self, path: Path, data: Path, ports: Mapping[str, int], extra: str = "", service: str = ""
    ) -> Path:
        """Write the plant file.

        Parameters
        ----------
        extra
            More tables, put before those of the units.
        service
            More lines of the table ``[service]``.
        """
        text = HEAD.format(
            data=data,
            service=service,
            segment=self.segment_samples,
            n_segments=self.n_segments,
            extra=extra,
            receiver=RECEIVER,
        )
        text += "".join(self._unit(unit, ports[unit]) for unit in self.units)
        tomllib.loads(text)
        path.write_text(text, encoding="utf-8")
        return path

    def _unit(self, unit: str, port: int) -> str:
        parts = [
            UNIT.format(
                id=unit, rpm=SPEED_RPM, rate=self.rate_hz, block=self.slot_samples, port=port
            )
        ]
        for bearing in BEARINGS:
            for kind in (SHAFT, VELOCITY):
                ids = [f"{bearing.lower()}_{kind[0]}_{axis}" for axis in "xy"]
                parts += [CHANNEL.format(id_, *kind) for id_ in ids]
        for id_, kind, most in SLOW:
            parts.append(SLOW_CHANNEL.format(id=id_, unit=kind, most=most))
        for bearing in BEARINGS:
            parts.append(
                BEARING.format(
                    id=bearing, low=bearing.lower(), alert=ALERT_UM_PK, deadband=DEADBAND_UM
                )
            )
        return "".join(parts)


class LedgerFeed:
    """A unit's converter; every sample follows from seed, channel, epoch and index.

    Parameters
    ----------
    t0_ns
        Time of sample 0, a whole number of microseconds.
    first_index
        Where it begins; a multiple of a slot.
    """

    def __init__(
        self, plant: LedgerPlant, unit: int, t0_ns: int, epoch: int = 1, first_index: int = 0
    ) -> None:
        self._truth = Truth(plant.seed, unit, plant.rate_hz, epoch)
        self._slot, self._t0_ns, self._next = plant.slot_samples, t0_ns, first_index

    def advance(self, n_samples: int) -> SampleBlock:
        """Produce the next samples, as one slot."""
        first, self._next = self._next, self._next + n_samples
        truth = self._truth
        return cell_block(
            epoch=truth.epoch,
            first_index=first,
            start_ns=self._t0_ns + round(first * NS_PER_S / truth.rate_hz) // 1000 * 1000,
            rate_hz=truth.rate_hz,
            counts=truth.counts(first, n_samples),
            ok=(True,) * N_CHANNELS,
            slow=truth.slow(first // self._slot),
        )


SLOW = (
    ("speed", "r/min", 1000.0),
    ("active_power", "MW", 900.0),
    *((f"{bearing.lower()}_oil_temperature", "degC", 110.0) for bearing in BEARINGS),
)

HEAD = """\
[plant]
name = "Ledger"

[service]
data_folder = "{data}"
{service}

[analysis]
segment_samples = {segment}
n_segments = {n_segments}
min_segments = 2
max_frequency_hz = 100.0

[capture]
samples = "not_kept"

[[delivery.receiver]]
id = "{receiver}"
kind = "webhook"
url = "http://127.0.0.1:9/"
kinds = ["order1_shaft_x", "order1_shaft_y"]
max_retry_s = 60.0

{extra}
"""

UNIT = """
[[unit]]
id = "{id}"
name = "Unit {id}"
rated_speed_rpm = {rpm}
rate_hz = {rate}
block_samples = {block}
speed_channel = "speed"
power_channel = "active_power"

[unit.source]
kind = "modbus_ring"
host = "127.0.0.1"
port = {port}

[unit.source.identity]
kind = "identification"
product_code = "{id}"
"""

SHAFT = ("shaft", "proximity_probe", 4.0, "V/mm", 12.0, 1.0, 11.0)
VELOCITY = ("bearing", "velocity", 100.0, "mV/(mm/s)", 10.0, -5.0, 5.0)
CHANNEL = """
[[unit.channel]]
id = "{0}"
transducer = "{2}"
sensitivity = {3}
sensitivity_unit = "{4}"
full_scale_v = {5}
ok_min_v = {6}
ok_max_v = {7}
"""

SLOW_CHANNEL = """
[[unit.slow_channel]]
id = "{id}"
unit = "{unit}"
minimum = 0.0
maximum = {most}
"""

BEARING = """
[[unit.bearing]]
id = "{id}"
bracket_stiffness_n_per_m = 1.18e9
bracket_mass_kg = 45.0e3
clearance_um = 300.0
gap_reference_um = [2000.0, 2000.0]
shaft_x = "{low}_shaft_x"
shaft_y = "{low}_shaft_y"
bearing_x = "{low}_bearing_x"
bearing_y = "{low}_bearing_y"
oil_temperature = "{low}_oil_temperature"

[unit.bearing.alarms.shaft_order1_um_pk]
alert = {alert}
deadband = {deadband}
on_delay_s = 0.0
off_delay_s = 0.0
states = ["standstill", "run_up", "speed_no_load", "part_load", "full_load", "run_down"]
"""
