"""Slow channels that are recorded beside the vibration, such as pad temperatures, head and gate."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class SlowQuantity:
    """Kind of slow quantity, such as pad temperature, with its names and units.

    Parameters
    ----------
    name
        Name in the plant file, and name of the alarm kind of its limits.
    suffix
        Unit at the end of the names of its readings.
    unit
        Displayed unit.
    setting
        Unit in the plant file.
    """

    name: str
    label: str
    suffix: str
    unit: str
    setting: str


def _table(suffix: str, unit: str, setting: str, **labels: str) -> dict[str, SlowQuantity]:
    return {name: SlowQuantity(name, of, suffix, unit, setting) for name, of in labels.items()}


SLOW_QUANTITIES: Mapping[str, SlowQuantity] = {
    **_table(
        "c",
        "°C",
        "degC",
        pad_temperature="Pad temperature",
        oil_inlet_temperature="Oil temperature, inlet",
        oil_outlet_temperature="Oil temperature, outlet",
        cooling_water_inlet_temperature="Cooling water temperature, inlet",
        cooling_water_outlet_temperature="Cooling water temperature, outlet",
        cold_air_temperature="Cold air temperature",
        hot_air_temperature="Hot air temperature",
        stator_temperature="Stator temperature",
        rotor_temperature="Rotor temperature",
    ),
    **_table("m", "m", "m", head="Head"),
    **_table("percent", "%", "%", gate_opening="Gate opening"),
    **_table("a", "A", "A", excitation_current="Excitation current"),
    **_table("v", "V", "V", excitation_voltage="Excitation voltage"),
}
"""Slow quantities by name: those that Brito et al., section 4, ask to monitor beside the oil
temperature and the shaft position, and those of the turbine and the excitation."""

PAD_TEMPERATURE = "pad_temperature"
"""Slow quantity from which the pattern of a bearing's pad temperatures is computed."""


@dataclass(frozen=True)
class SlowChannel:
    """Slow channel with a recorded quantity.

    Parameters
    ----------
    quantity
        Key of `SLOW_QUANTITIES`.
    bearing
        Id of the bearing; None for a quantity of the unit, which is recorded with every bearing.
    position
        Number or word that distinguishes the channels of one quantity; may be empty.
    angle_deg
        Angle of the position around the bearing, from x towards y; None if unknown.
    """

    id: str
    quantity: str
    bearing: str | None = None
    position: str = ""
    angle_deg: float | None = None

    @property
    def reading(self) -> str:
        """Name of the channel's reading, such as "pad_temperature_3_c"."""
        parts = (self.quantity, self.position, SLOW_QUANTITIES[self.quantity].suffix)
        return "_".join(filter(None, parts))
