"""The catalogue of everything padwatch reports about a bearing: name, unit and words for people."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """A reported quantity.

    Parameters
    ----------
    name
        As in the API and the store: quantity, kind, unit, detector.
    unit
        UCUM-like, as shown to people.
    label
        What it is, in a few words.
    """

    name: str
    unit: str
    label: str


def _order_quantities(prefix: str, words: str) -> tuple[Quantity, ...]:
    return (
        Quantity(f"{prefix}_frequency_hz", "Hz", f"Frequency of {words}"),
        Quantity(f"{prefix}_shaft_x_um_pk", "µm 0-pk", f"Relative shaft vibration x, {words}"),
        Quantity(f"{prefix}_shaft_y_um_pk", "µm 0-pk", f"Relative shaft vibration y, {words}"),
        Quantity(f"{prefix}_bearing_x_um_pk", "µm 0-pk", f"Absolute bearing vibration x, {words}"),
        Quantity(f"{prefix}_bearing_y_um_pk", "µm 0-pk", f"Absolute bearing vibration y, {words}"),
        Quantity(f"{prefix}_k_eff_xx_n_per_m", "N/m", f"Effective stiffness x, {words}"),
        Quantity(f"{prefix}_k_eff_yy_n_per_m", "N/m", f"Effective stiffness y, {words}"),
        Quantity(f"{prefix}_coherence_xx", "1", f"Coherence of shaft and bearing x, {words}"),
        Quantity(f"{prefix}_coherence_yy", "1", f"Coherence of shaft and bearing y, {words}"),
    )


CATALOGUE: tuple[Quantity, ...] = (
    Quantity("speed_rpm", "r/min", "Running speed"),
    Quantity("power_mw", "MW", "Active power"),
    Quantity("oil_temperature_c", "°C", "Oil temperature"),
    Quantity("gap_x_um", "µm", "Mean probe gap x"),
    Quantity("gap_y_um", "µm", "Mean probe gap y"),
    Quantity("shaft_centre_x_um", "µm", "Shaft centre x"),
    Quantity("shaft_centre_y_um", "µm", "Shaft centre y"),
    Quantity("eccentricity_ratio", "1", "Eccentricity ratio"),
    Quantity("attitude_angle_deg", "deg", "Attitude angle"),
    *_order_quantities("order1", "1×"),
    *_order_quantities("vortex", "vortex"),
)

BY_NAME = {quantity.name: quantity for quantity in CATALOGUE}
