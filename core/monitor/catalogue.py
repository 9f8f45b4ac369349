"""The catalogue of everything padwatch reports about a bearing: name, unit and words for people."""

from dataclasses import dataclass

from core.quality import AXES


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
    has_uncertainty
        Whether its readings state a random and a systematic standard uncertainty.
    keeps_uncertainty
        Whether these are stored as well, for trends: of results, not of what they come from.
    """

    name: str
    unit: str
    label: str
    has_uncertainty: bool = False
    keeps_uncertainty: bool = False


LIVE = (True, False)
STORED = (True, True)


def _order_quantities(prefix: str, words: str) -> tuple[Quantity, ...]:
    return (
        Quantity(f"{prefix}_frequency_hz", "Hz", f"Frequency of {words}", *LIVE),
        Quantity(
            f"{prefix}_shaft_x_um_pk", "µm 0-pk", f"Relative shaft vibration x, {words}", *LIVE
        ),
        Quantity(
            f"{prefix}_shaft_y_um_pk", "µm 0-pk", f"Relative shaft vibration y, {words}", *LIVE
        ),
        Quantity(
            f"{prefix}_bearing_x_um_pk", "µm 0-pk", f"Absolute bearing vibration x, {words}", *LIVE
        ),
        Quantity(
            f"{prefix}_bearing_y_um_pk", "µm 0-pk", f"Absolute bearing vibration y, {words}", *LIVE
        ),
        Quantity(
            f"{prefix}_roundness", "1", f"Roundness of the shaft's orbit, {words}, forward +", *LIVE
        ),
        Quantity(
            f"{prefix}_coherence_xx", "1", f"Coherence of shaft and bearing x, {words}", *LIVE
        ),
        Quantity(
            f"{prefix}_coherence_yy", "1", f"Coherence of shaft and bearing y, {words}", *LIVE
        ),
        *_in_both_directions(
            f"{prefix}_k_eff", "N/m", f"Effective stiffness, {words}, equation (5)"
        ),
        *_in_both_directions(f"{prefix}_transfer_k", "N/m", f"Stiffness, {words}, transfer"),
        *_in_both_directions(f"{prefix}_transfer_c", "N·s/m", f"Damping, {words}, transfer"),
    )


def _in_both_directions(prefix: str, unit: str, words: str) -> tuple[Quantity, ...]:
    return tuple(_coefficient(prefix, axes, unit, words) for axes in ("xx", "yy"))


def _coefficient(prefix: str, axes: str, unit: str, words: str) -> Quantity:
    suffix = {"N/m": "n_per_m", "N·s/m": "n_s_per_m"}[unit]
    return Quantity(f"{prefix}_{axes}_{suffix}", unit, f"{words}, {axes}", *STORED)


CATALOGUE: tuple[Quantity, ...] = (
    *_in_both_directions("stiffness", "N/m", "Film stiffness by the preferred estimator"),
    Quantity("speed_rpm", "r/min", "Running speed", *LIVE),
    Quantity("power_mw", "MW", "Active power", *LIVE),
    Quantity("oil_temperature_c", "°C", "Oil temperature", *LIVE),
    Quantity("gap_x_um", "µm", "Mean probe gap x", *LIVE),
    Quantity("gap_y_um", "µm", "Mean probe gap y", *LIVE),
    Quantity("opposite_gap_x_um", "µm", "Mean gap of the probe opposite x", *LIVE),
    Quantity("opposite_gap_y_um", "µm", "Mean gap of the probe opposite y", *LIVE),
    Quantity("gap_growth_um", "µm", "Thermal growth of all gaps", *STORED),
    Quantity("shaft_centre_x_um", "µm", "Shaft centre x", *STORED),
    Quantity("shaft_centre_y_um", "µm", "Shaft centre y", *STORED),
    Quantity("eccentricity_ratio", "1", "Eccentricity ratio", *STORED),
    Quantity("attitude_angle_deg", "deg", "Attitude angle", *STORED),
    *_order_quantities("order1", "1×"),
    Quantity("order1_shaft_x_phase_deg", "deg", "Phase of relative shaft vibration x, 1×", *LIVE),
    Quantity("order1_shaft_y_phase_deg", "deg", "Phase of relative shaft vibration y, 1×", *LIVE),
    Quantity(
        "order1_bearing_x_phase_deg", "deg", "Phase of absolute bearing vibration x, 1×", *LIVE
    ),
    Quantity(
        "order1_bearing_y_phase_deg", "deg", "Phase of absolute bearing vibration y, 1×", *LIVE
    ),
    Quantity("overall_shaft_x_um_pp", "µm pk-pk", "Relative shaft vibration x, broad-band", *LIVE),
    Quantity("overall_shaft_y_um_pp", "µm pk-pk", "Relative shaft vibration y, broad-band", *LIVE),
    Quantity(
        "overall_shaft_um_pk", "µm 0-pk", "Farthest excursion of the shaft, broad-band", *LIVE
    ),
    Quantity("overall_bearing_x_mm_s_rms", "mm/s rms", "Bearing velocity x, broad-band", *LIVE),
    Quantity("overall_bearing_y_mm_s_rms", "mm/s rms", "Bearing velocity y, broad-band", *LIVE),
    *_order_quantities("vortex", "vortex"),
    *(_coefficient("dynamic_k", axes, "N/m", "Film stiffness, dynamic") for axes in AXES),
    *(_coefficient("dynamic_c", axes, "N·s/m", "Film damping, dynamic") for axes in AXES),
    Quantity(
        "dynamic_coherence_x", "1", "Share of the bearing's motion x that the film explains", *LIVE
    ),
    Quantity(
        "dynamic_coherence_y", "1", "Share of the bearing's motion y that the film explains", *LIVE
    ),
    Quantity("dynamic_lack_of_fit_x", "1", "Lack of fit of the film x, about 1 if it fits"),
    Quantity("dynamic_lack_of_fit_y", "1", "Lack of fit of the film y, about 1 if it fits"),
    Quantity("dynamic_n_lines", "1", "Spectral lines used by dynamic"),
    Quantity("dynamic_delay_s", "s", "Delay of the bearing channels that dynamic finds", *LIVE),
    Quantity("dynamic_bracket_mass_kg", "kg", "Bracket mass, fitted where none is given", *LIVE),
)

BY_NAME = {quantity.name: quantity for quantity in CATALOGUE}
