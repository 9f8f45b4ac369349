"""Settings of the waveform and slow channels of a unit, and of the slow-roll runout."""

import cmath
import math
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import AwareDatetime, Field, StringConstraints, model_validator

from core.checks.channels import COUNTS_FULL_SCALE
from core.machine.channel import (
    PAD_TEMPERATURE,
    SLOW_QUANTITIES,
    Measurand,
    SlowChannel,
    SlowRollVector,
)
from core.monitor.catalogue import BY_NAME
from core.units import STANDARD_GRAVITY_M_S2
from service.settings.base import Identifier, MisfitError, MissingError, Settings
from service.settings.limits import SlowLimitSettings
from service.settings.transducers import ResponseSettings

ProbeName = Annotated[str, StringConstraints(min_length=1, max_length=80)]
"""Serial number or other unique mark of a probe."""


class SlowRollSettings(Settings):
    """Slow-roll vector: 1× runout at a shaft probe, measured at a speed too low for vibration."""

    um_pk: Annotated[float, Field(ge=0.0, le=1000.0)]
    """Amplitude, µm zero-to-peak; example: 8.0."""

    phase_deg: Annotated[float, Field(ge=-360.0, le=360.0)]
    """Phase of the displacement along the bearing axis relative to the key-phase pulse, degrees,
    positive for lead. An instrument that shows phase lag, from the pulse to the next positive peak
    (API 670), shows this phase with the opposite sign. Example: 30.0."""

    speed_rpm: Annotated[float, Field(gt=0.0, le=1500.0)]
    """Speed of the measurement, r/min. The vector is used only if this speed is at most a quarter
    of the rated speed. Example: 8.0."""

    taken: AwareDatetime
    """Time of the measurement, with offset from UTC; example: 2026-03-01T10:00:00Z."""

    probe: ProbeName
    """Serial number or mark of the measured probe; the vector is not used for another probe.
    Example: "SN123"."""

    def vector(self) -> SlowRollVector:
        """Return the settings as the `SlowRollVector` of a channel."""
        phasor_um_pk = cmath.rect(self.um_pk, math.radians(self.phase_deg))
        return SlowRollVector(self.probe, phasor_um_pk, self.speed_rpm)


class Transducer(StrEnum):
    """Kind of the transducer of a waveform channel."""

    PROXIMITY_PROBE = "proximity_probe"
    DISPLACEMENT = "displacement"
    VELOCITY = "velocity"
    ACCELEROMETER = "accelerometer"
    KEY_PHASE = "key_phase"


class SensitivityUnit(StrEnum):
    """Unit of a transducer's sensitivity."""

    V_PER_MM = "V/mm"
    MV_PER_UM = "mV/um"
    MV_PER_MM_S = "mV/(mm/s)"
    MV_PER_M_S2 = "mV/(m/s2)"
    MV_PER_G = "mV/g"


MEASURANDS = {
    Transducer.PROXIMITY_PROBE: Measurand.GAP_UM,
    Transducer.DISPLACEMENT: Measurand.DISPLACEMENT_UM,
    Transducer.VELOCITY: Measurand.VELOCITY_MM_S,
    Transducer.ACCELEROMETER: Measurand.ACCELERATION_M_S2,
    Transducer.KEY_PHASE: Measurand.KEY_PHASE_V,
}

LENGTH_UNITS = (SensitivityUnit.V_PER_MM, SensitivityUnit.MV_PER_UM)
ACCELERATION_UNITS = (SensitivityUnit.MV_PER_G, SensitivityUnit.MV_PER_M_S2)
SENSITIVITIES = {
    Transducer.PROXIMITY_PROBE: (LENGTH_UNITS, 0.5e-3, 50e-3),
    Transducer.DISPLACEMENT: (LENGTH_UNITS, 0.05e-3, 500e-3),
    Transducer.VELOCITY: ((SensitivityUnit.MV_PER_MM_S,), 0.5e-3, 2.0),
    Transducer.ACCELEROMETER: (ACCELERATION_UNITS, 0.5e-3, 2.0),
}
"""Units and range of plausible sensitivities, the range in V per µm, mm/s or m/s²; a value outside
the range indicates a wrong unit."""

V_PER_ENGINEERING_UNIT = {
    SensitivityUnit.V_PER_MM: 1e-3,
    SensitivityUnit.MV_PER_UM: 1e-3,
    SensitivityUnit.MV_PER_MM_S: 1e-3,
    SensitivityUnit.MV_PER_M_S2: 1e-3,
    SensitivityUnit.MV_PER_G: 1e-3 / STANDARD_GRAVITY_M_S2,
}
"""Factors from a sensitivity in each unit to volts per µm, mm/s or m/s²."""

LINE_FLOORS = {
    Transducer.PROXIMITY_PROBE: 0.1,
    Transducer.DISPLACEMENT: 0.1,
    Transducer.VELOCITY: 1e-3,
    Transducer.ACCELEROMETER: 2e-5,
    Transducer.KEY_PHASE: 0.0,
}
"""Default noise amplitude of a spectral line by transducer, zero-to-peak in µm, mm/s or m/s²."""

SHAFT_TRANSDUCERS = (Transducer.PROXIMITY_PROBE, Transducer.DISPLACEMENT)
"""Transducers that measure shaft motion and therefore also runout."""

SCALE_KEYS_V = ("full_scale_v", "ok_min_v", "ok_max_v")
SCALE_KEYS_COUNTS = ("unit_per_count", "ok_min", "ok_max")
VOLTAGE_KEYS = ("sensitivity", "sensitivity_unit")
NO_KEY_PHASE_KEYS = (
    *("sensitivity", "sensitivity_unit", "response", "delay_s", "line_floor", "probe"),
    *("slow_roll", "angle_deg"),
)
"""Keys that do not apply to a key_phase channel, because the height of its pulses has no
meaning."""


class ChannelSettings(Settings):
    """Settings of a waveform channel; channels are listed in the order of the device."""

    id: Identifier
    """Id of the channel, unique within the unit; example: "ujb_shaft_x"."""

    transducer: Transducer
    """Kind of the transducer: "proximity_probe" (DC-coupled gap), "displacement", "velocity",
    "accelerometer" or "key_phase" (one pulse per turn)."""

    sensitivity: float | None = None
    """Sensitivity in ``sensitivity_unit``, negative if the voltage falls while the measured
    quantity increases; required except for a key_phase; example: 4.0."""

    sensitivity_unit: SensitivityUnit | None = None
    """Unit of the sensitivity: "V/mm" or "mV/um" for probes and displacement, "mV/(mm/s)" for
    velocity, "mV/g" or "mV/(m/s2)" for accelerometers."""

    full_scale_v: Annotated[float, Field(gt=0.0, le=100.0)] | None = None
    """Input voltage of the converter at 32768 counts, V; example: 12.0."""

    ok_min_v: Annotated[float, Field(ge=-100.0, le=100.0)] | None = None
    """Minimum mean voltage of a healthy transducer (gap OK limit), V; example: 1.0."""

    ok_max_v: Annotated[float, Field(ge=-100.0, le=100.0)] | None = None
    """Maximum mean voltage of a healthy transducer (gap OK limit), V; example: 11.0."""

    unit_per_count: float | None = None
    """Scale of a device with scaled counts, instead of the sensitivity and all keys in volts: µm,
    mm/s or m/s² per count (V for a key_phase), negative if the counts fall while the measured
    quantity increases; example: 0.0625."""

    ok_min: float | None = None
    """Minimum mean of a healthy transducer with unit_per_count, in µm, mm/s, m/s² or V; example:
    250.0."""

    ok_max: float | None = None
    """Maximum mean of a healthy transducer with unit_per_count, in µm, mm/s, m/s² or V; example:
    2750.0."""

    gain_uncertainty: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.05
    """Half-width of the relative error of the sensitivity, from the accuracy class of the
    transducer; example: 0.05."""

    response: Annotated[tuple[ResponseSettings, ...], Field(max_length=8)] = ()
    """Frequency response of the transducer as a chain of elements; flat by default. Example: [{
    kind = "high_pass", corner_hz = 0.5 }]."""

    delay_s: Annotated[float, Field(ge=-1.0, le=1.0)] = 0.0
    """Delay of the channel relative to the other channels, s, due to sequential sampling or to a
    filter that other channels do not have; example: 0.00167."""

    line_floor: Annotated[float, Field(ge=0.0, le=1000.0)] | None = None
    """Amplitude of a spectral line, zero-to-peak in µm, mm/s or m/s², below which the line may be
    noise of the transducer and no stiffness is computed from it. Default: 2e-5 m/s² for an
    accelerometer, which is 5 µg/√Hz in a line of 0.07 Hz, 0.001 mm/s for a velocity transducer, 0.1
    µm for others."""

    direction: Literal[1, -1] | None = None
    """Sign of the channel: +1 if the reading increases with motion along the positive bearing axis,
    -1 if it decreases. Default: -1 for a proximity probe, which is mounted on the positive axis;
    otherwise +1. For a key_phase, -1 if the pulses are negative."""

    angle_deg: Annotated[float, Field(ge=-360.0, le=360.0)] | None = None
    """Angle from x towards y of the axis that the transducer measures along, degrees; by default 0
    or 90, the axis of the bearing's key that names the channel. A positive ``direction`` then means
    motion along this axis. The signals of both transducers are resolved into x and y. Example:
    45.0."""

    probe: ProbeName | None = None
    """Serial number or mark of the installed shaft probe, the same as in slow_roll; example:
    "SN123"."""

    slow_roll: SlowRollSettings | None = None
    """Runout of the shaft at this probe. The runout is subtracted from the 1× vector while a
    key-phase is available. Example: { um_pk = 8.0, phase_deg = 30.0, speed_rpm = 8.0, taken =
    2026-03-01T10:00:00Z, probe = "SN123" }."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        self._check_scale()
        if self.transducer is Transducer.KEY_PHASE:
            self._check_key_phase()
        else:
            if self.unit_per_count is None:
                self._check_sensitivity()
            self._check_runout()
        return self

    def _check_scale(self) -> None:
        in_counts = self.unit_per_count is not None
        keys, others = (
            (SCALE_KEYS_COUNTS, SCALE_KEYS_V) if in_counts else (SCALE_KEYS_V, SCALE_KEYS_COUNTS)
        )
        for key in (*others, *(VOLTAGE_KEYS if in_counts else ())):
            if getattr(self, key) is not None:
                which = "without" if in_counts else "with"
                words = f"applies only to a channel {which} unit_per_count; remove it"
                raise MisfitError(words, key)
        for key in keys:
            if getattr(self, key) is None:
                raise MissingError("is missing", key)
        if self.unit_per_count == 0.0:
            raise MisfitError("must not be 0", "unit_per_count")
        low, high = keys[1:]
        if not getattr(self, low) < getattr(self, high):
            raise MisfitError(f"must be below {high} = {getattr(self, high):g}", low)

    def _check_key_phase(self) -> None:
        for key in NO_KEY_PHASE_KEYS:
            if getattr(self, key) not in (None, (), 0.0):
                raise MisfitError("does not apply to a key_phase channel; remove it", key)

    def _check_runout(self) -> None:
        for key in ("probe", "slow_roll"):
            if getattr(self, key) is not None and self.transducer not in SHAFT_TRANSDUCERS:
                words = " or ".join(f'"{name}"' for name in SHAFT_TRANSDUCERS)
                raise MisfitError(f"applies only to transducer {words}, not {self.transducer}", key)
        if self.slow_roll is not None and self.probe is None:
            raise MissingError("is missing; slow_roll applies to one probe", "probe")

    def _check_sensitivity(self) -> None:
        allowed, low, high = SENSITIVITIES[self.transducer]
        if self.sensitivity_unit not in allowed:
            words = " or ".join(f'"{unit}"' for unit in allowed)
            raise MisfitError(f"must be {words} for {self.transducer}", "sensitivity_unit")
        scale = V_PER_ENGINEERING_UNIT[self.sensitivity_unit]
        if self.sensitivity is None or not low <= abs(self.sensitivity) * scale <= high:
            raise MisfitError(
                f"must be {low / scale:g} to {high / scale:g} {self.sensitivity_unit} (positive"
                f" or negative) for transducer {self.transducer}",
                "sensitivity",
            )

    @property
    def measurand(self) -> Measurand:
        """Measured quantity and its engineering unit."""
        return MEASURANDS[self.transducer]

    @property
    def unit_per_v(self) -> float:
        """Engineering units per volt, or per count; 1 V per volt for a key_phase in volts."""
        if self.unit_per_count is not None:
            return self.unit_per_count
        if self.sensitivity is None or self.sensitivity_unit is None:
            return 1.0
        return 1.0 / (self.sensitivity * V_PER_ENGINEERING_UNIT[self.sensitivity_unit])

    @property
    def scale(self) -> dict[str, float]:
        """Arguments of `ChannelCalibration`, by name; with `unit_per_count`, a count is 1 V."""
        full_scale, low, high = (getattr(self, key) for key in SCALE_KEYS_V)
        if self.unit_per_count is not None:
            limits = (
                float(getattr(self, key)) / self.unit_per_count for key in SCALE_KEYS_COUNTS[1:]
            )
            full_scale, (low, high) = float(COUNTS_FULL_SCALE), sorted(limits)
        return {
            "full_scale_v": full_scale,
            "unit_per_v": self.unit_per_v,
            "ok_min_v": low,
            "ok_max_v": high,
        }

    @property
    def floor(self) -> float:
        """Value of `line_floor` or the transducer's default, 0-pk in the unit of `measurand`."""
        return LINE_FLOORS[self.transducer] if self.line_floor is None else self.line_floor

    @property
    def sign(self) -> int:
        """Sign of the channel, +1 or -1: `direction`, or the default of the transducer."""
        if self.direction is not None:
            return self.direction
        return -1 if self.transducer is Transducer.PROXIMITY_PROBE else 1


SlowUnit = Literal["r/min", "MW", "degC", "mm", "m", "%", "A", "V"]

if TYPE_CHECKING:
    SlowQuantityName = str
else:
    SlowQuantityName = Literal[tuple(SLOW_QUANTITIES)]
"""Name of a recorded slow quantity, validated by pydantic."""


class SlowChannelSettings(Settings):
    """Settings of a slow channel, which has single values instead of a waveform.

    Slow channels are listed in the order of the device.
    """

    id: Identifier
    """Id of the slow channel, unique within the unit; example: "ujb_oil_temperature"."""

    unit: SlowUnit
    """Unit of the values that the device sends: "r/min", "MW", "degC", "mm", "m", "%", "A" or
    "V"."""

    minimum: float
    """Lower limit of valid values, in `unit`; lower values are rejected as out of range. Example:
    -10.0."""

    maximum: float
    """Upper limit of valid values, in `unit`; higher values are rejected as out of range. Example:
    120.0."""

    quantity: SlowQuantityName | None = None
    """Quantity that the channel measures. Its values are then recorded with the results of the
    bearing, or of all bearings of the unit, and shown as trends. No default; a channel that a key
    of the unit or of a bearing names needs no quantity. Example: "pad_temperature"."""

    bearing: Identifier | None = None
    """Bearing that the quantity belongs to; by default the unit. Required for a pad_temperature.
    Example: "UJB"."""

    position: Annotated[str, StringConstraints(pattern=r"^[a-z0-9]+(_[a-z0-9]+)*$")] | None = None
    """Number or word, in lower case, that distinguishes the channels of one quantity; example:
    "3"."""

    angle_deg: Annotated[float, Field(ge=-360.0, le=360.0)] | None = None
    """Angle of the pad around the bearing, degrees from x towards y; only for a pad_temperature.
    The first harmonic of the pad temperatures requires the angles of all pads. Example: 45.0."""

    limits: SlowLimitSettings | None = None
    """Alarm limits of the quantity; none by default. Example: { alert = 80.0, danger = 90.0 }."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if not self.minimum < self.maximum:
            raise MisfitError(f"must be below maximum = {self.maximum:g}", "minimum")
        if self.quantity is None:
            for key in ("bearing", "position", "angle_deg", "limits"):
                if getattr(self, key) is not None:
                    raise MisfitError("requires quantity; add quantity or remove this key", key)
            return self
        unit, is_pad = SLOW_QUANTITIES[self.quantity].setting, self.quantity == PAD_TEMPERATURE
        if self.unit != unit:
            raise MisfitError(f'must be "{unit}" for quantity {self.quantity}', "unit")
        if is_pad and self.bearing is None:
            raise MissingError(f"is missing; quantity {self.quantity} requires it", "bearing")
        if self.angle_deg is not None and not is_pad:
            raise MisfitError("applies only to quantity pad_temperature; remove it", "angle_deg")
        if self.recorded is not None and self.recorded.reading in BY_NAME:
            raise MisfitError("is the name of a computed value; use another word", "position")
        return self

    @property
    def recorded(self) -> SlowChannel | None:
        """The channel as a `SlowChannel` of the machine; None without a quantity."""
        if self.quantity is None:
            return None
        place = (self.bearing, self.position or "", self.angle_deg)
        return SlowChannel(self.id, self.quantity, *place)
