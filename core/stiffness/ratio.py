"""The paper's estimator: effective film stiffness from two amplitudes and the bracket."""


def effective_stiffness_n_per_m(
    bearing_um_pk: float, shaft_um_pk: float, bracket_stiffness_n_per_m: float
) -> float:
    """Effective stiffness ``|k + iωc|`` of an oil film at one spectral line.

    Parameters
    ----------
    bearing_um_pk
        Absolute displacement of the bearing.
    shaft_um_pk
        Displacement of the shaft relative to the bearing, same direction and line. The two
        amplitudes may carry any unit and detector as long as it is the same.
    bracket_stiffness_n_per_m
        Radial stiffness k_b of the bracket. Its inertia is left out, which biases the result by
        m_b ω² / k_b (+0.4 % on the paper's machine at rated speed).

    Raises
    ------
    ValueError
        If the shaft amplitude is not positive.
    """
    if not shaft_um_pk > 0.0:
        raise ValueError(f"shaft amplitude must be above 0 µm, got {shaft_um_pk}")
    # Brito et al., equation (5): k_eff = |X_b| / |U| · k_b
    return bearing_um_pk / shaft_um_pk * bracket_stiffness_n_per_m
