"""All eight coefficients: exact on exact motion, honest on noisy motion, else a reason."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rigs.shaken_shaft import (
    BRACKET,
    DAMPING,
    NOISE_FREE,
    STIFFNESS,
    TURN_HZ,
    averaged,
    dynamic_stiffness,
    found,
)

from benchmarks.flexible_rotor import BIN_HZ, FREQUENCY_HZ, hann_noise
from core.arrays import ComplexArray, FloatArray
from core.machine.unit import Bearing
from core.quality import GOOD, Reason, missing
from core.spectra.cross_spectrum import phasor_power_per_density
from core.stiffness.dynamic import DynamicStiffness, FilmSpectrum, films
from core.stiffness.dynamic_lines import DynamicSettings
from core.stiffness.dynamic_readings import dynamic_readings
from core.stiffness.estimators import (
    DYNAMIC_COEFFICIENTS,
    ESTIMATORS,
    TRANSFERS,
    signs_checked,
)
from core.stiffness.fitted_films import DELAY
from core.stiffness.fitted_films import STIFFNESS as STIFFENING

Recording = Callable[..., ComplexArray]


PROBE_UM = float(np.sqrt(0.05 * phasor_power_per_density(BIN_HZ)))
"""Amplitude of probe noise of 0.05 µm²/Hz."""


def test_exact_motion_gives_all_coefficients_whatever_its_axes_and_its_size(recording):
    result = found(recording())

    np.testing.assert_allclose(result.k_n_per_m, STIFFNESS, rtol=1e-7)
    np.testing.assert_allclose(result.coefficients[:, 2:], DAMPING, rtol=1e-7)
    np.testing.assert_allclose(result.coherence, 1.0)
    np.testing.assert_allclose(found(recording(n_segments=4)).k_n_per_m, STIFFNESS, rtol=1e-6)
    few = averaged(recording(n_segments=3))
    assert dynamic_stiffness(few, BRACKET, TURN_HZ, NOISE_FREE) is Reason.FEW_SEGMENTS

    phasors = recording(bearing_um=0.3)

    straight, swapped = found(phasors), found(phasors[:, [1, 0, 3, 2]])

    np.testing.assert_allclose(swapped.k_n_per_m, straight.k_n_per_m[::-1, ::-1], rtol=1e-8)
    np.testing.assert_allclose(swapped.std[:, 2:], straight.std[::-1, 3:1:-1])
    np.testing.assert_allclose(found(1e-3 * phasors).k_n_per_m, straight.k_n_per_m, rtol=1e-9)


def test_a_gain_error_moves_the_coefficients_it_reaches_and_no_other(recording):
    phasors = recording()
    gain = np.array([1.0, 1.04, 0.97, 1.0])  # u_y reads high, v_x reads low

    result = found(phasors * gain[:, np.newaxis])

    expected = STIFFNESS * np.array([[0.97], [1.0]]) / np.array([1.0, 1.04])
    np.testing.assert_allclose(result.k_n_per_m, expected, rtol=1e-7)


def test_the_stated_change_with_the_bracket_is_the_change(recording):
    phasors = recording(bearing_um=0.1)
    spectrum = averaged(phasors)
    stiffer = replace(BRACKET, stiffness_n_per_m=1.01 * BRACKET.stiffness_n_per_m)

    result = found(phasors)
    changed = dynamic_stiffness(spectrum, stiffer, TURN_HZ, NOISE_FREE)

    assert isinstance(changed, DynamicStiffness)
    # Not to the last digit: with another bracket the weights move.
    np.testing.assert_allclose(
        changed.k_n_per_m - result.k_n_per_m, 0.01 * result.changes[STIFFENING, :, :2], rtol=0.02
    )


def rms_z(results: list[DynamicStiffness]) -> FloatArray:
    """Root mean square of error over stated random uncertainty: (k, c) by (2, 2)."""
    errors = np.array([(r.k_n_per_m - STIFFNESS, r.coefficients[:, 2:] - DAMPING) for r in results])
    stated = np.array([(r.std[:, :2], r.std[:, 2:]) for r in results])
    z: FloatArray = np.sqrt(((errors / stated) ** 2).mean(axis=0))
    return z


def test_a_bracket_mass_that_is_not_known_is_fitted_and_stated_with_its_uncertainty(recording):
    unknown = replace(BRACKET, mass_kg=None)
    exact = found(recording(), bracket=unknown)
    np.testing.assert_allclose(exact.k_n_per_m, STIFFNESS, rtol=1e-5)
    assert exact.bracket_mass_kg == pytest.approx(BRACKET.mass_kg, rel=1e-4)

    noisy = [
        found(recording(seed, probe_um=0.1, bearing_um=0.05), DynamicSettings(), unknown)
        for seed in range(60)
    ]

    masses = np.array([(r.bracket_mass_kg, r.bracket_mass_std_kg) for r in noisy])
    # it enters the product with the film, whose errors leave a little bias
    assert masses[:, 0].mean() == pytest.approx(45e3, abs=0.6 * masses[:, 1].mean())
    # 60 runs of four coefficients, good to 5 %, and 9 % for the mass alone
    assert np.sqrt((rms_z(noisy) ** 2).mean(axis=(1, 2))) == pytest.approx(1.0, abs=0.15)
    assert masses[:, 0].std() == pytest.approx(masses[:, 1].mean(), rel=0.27)
    mean = np.mean([r.k_n_per_m for r in noisy], axis=0)
    np.testing.assert_allclose(mean, STIFFNESS, atol=0.005 * STIFFNESS[0, 0])


def test_probe_noise_in_the_shafts_motion_is_part_of_the_stated_uncertainty(recording):
    """A sixth of the motion is noise, taken off with a floor that is itself estimated."""
    loud = [
        found(recording(seed, probe_um=0.3, bearing_um=0.05), DynamicSettings())
        for seed in range(150)
    ]

    # 150 runs: good to 6 % each
    assert np.diag(rms_z(loud)[0]) == pytest.approx(1.0, abs=0.12)


def test_channels_that_are_late_show_as_a_delay_and_are_put_right_by_it(recording):
    late = recording(bearing_um=0.05)
    late[:, 2:] *= np.exp(-2j * np.pi * FREQUENCY_HZ / 600.0)

    result = found(late)

    assert result.delay_s == pytest.approx(1.0 / 600.0, abs=4.0 * result.delay_std_s)
    assert result.delay_std_s < 4e-4
    change = result.delay_s * result.changes[DELAY, :, 2:]
    right = found(recording(bearing_um=0.05))
    np.testing.assert_allclose(
        result.coefficients[:, 2:] + change, right.coefficients[:, 2:], atol=0.06 * DAMPING[0, 0]
    )


@pytest.mark.parametrize("probe_um2_per_hz", [None, 0.05])
def test_probe_noise_that_is_taken_off_leaves_no_bias(recording, probe_um2_per_hz):
    known = None if probe_um2_per_hz is None else (probe_um2_per_hz,) * 2
    settings = DynamicSettings(probe_noise_um2_per_hz=known)

    noisy = [recording(seed, probe_um=PROBE_UM) for seed in range(20)]
    ignored, corrected = (
        np.mean([found(phasors, chosen).k_n_per_m for phasors in noisy], axis=0)
        for chosen in (NOISE_FREE, settings)
    )

    assert ignored[0, 0] < 0.99 * STIFFNESS[0, 0]
    # 20 runs of 0.3 % scatter; the estimated floor of two unmoved decades is good to 5 %.
    np.testing.assert_allclose(corrected, STIFFNESS, atol=0.003 * STIFFNESS[0, 0])


def test_the_floor_of_few_segments_is_not_low(recording):
    few = (recording(seed, probe_um=PROBE_UM, n_segments=6) for seed in range(20))

    floors = [found(phasors, DynamicSettings()) for phasors in few]

    # Two of six freedoms go into what shaft and bearing share: without them it would be 33 % low.
    mean = np.mean([result.probe_noise_um2_per_hz for result in floors])
    assert mean == pytest.approx(0.05, rel=0.08)


def test_noise_share_is_the_part_of_the_shafts_motion_that_is_not_motion(recording):
    small = replace(NOISE_FREE, band_hz=(0.6, 3.0))  # where the motion is flat
    probe_um = 0.5
    density = probe_um**2 / phasor_power_per_density(BIN_HZ)
    known = replace(small, probe_noise_um2_per_hz=(density, density))

    assert found(recording(), small).noise_share == 0.0
    # 0.25 of noise on 1 of motion; the motion falls a little within the band
    noisy = found(recording(n_segments=400, probe_um=probe_um), known)
    assert noisy.noise_share == pytest.approx(0.2, abs=0.015)


def scatter_over_stated(results: list[DynamicStiffness]) -> FloatArray:
    k = np.array([result.k_n_per_m for result in results])
    stated = np.array([result.std[:, :2] for result in results])
    ratio: FloatArray = k.std(axis=0) / np.sqrt((stated**2).mean(axis=0))
    return ratio


def test_the_stated_uncertainty_is_the_scatter_also_where_integration_alone_limits(recording):
    results = [found(recording(seed, bearing_um=0.3)) for seed in range(150)]

    # The scatter of 150 runs is known to 6 %; four figures, three times that.
    np.testing.assert_allclose(scatter_over_stated(results), 1.0, atol=0.18)

    results = [found(integrated_at_the_bins(seed), n_integrations=(2, 2)) for seed in range(150)]

    damping = np.array([result.coefficients[:, 2:] for result in results]).std(axis=0)
    stated = np.mean([result.std[:, 2:] for result in results], axis=0)
    # Edges between used and unused lines are not followed exactly: a fifth, beside 6 % by chance.
    assert np.diag(scatter_over_stated(results)) == pytest.approx(1.0, abs=0.25)
    assert np.diag(damping / stated) == pytest.approx(1.0, abs=0.25)


def test_damping_over_stiffness_scatters_as_it_says_and_no_gain_or_bracket_moves_it(recording):
    unit = Bearing("UJB", 1.18e9, "ux", "uy", "vx", "vy", 500.0, (2000.0, 2000.0))
    said = [
        dynamic_readings(unit, found(recording(seed, bearing_um=0.3)), GOOD)[0]
        for seed in range(100)
    ]
    ck = np.array([[each[f"dynamic_ck_{axes}_s"].value for axes in ("xx", "yy")] for each in said])
    stated = np.array([[each[f"dynamic_ck_{a}_s"].u_random for a in ("xx", "yy")] for each in said])
    # 100 runs tell it to 7 %; errors taken as independent would be off by 15 %
    assert np.std(ck, axis=0) / np.mean(stated, axis=0) == pytest.approx([1.0, 1.0], abs=0.2)
    truth = np.diag(DAMPING) / np.diag(STIFFNESS)
    assert np.mean(ck, axis=0) == pytest.approx(truth, rel=0.01)

    gain = np.array([1.04, 1.04, 0.97, 0.97])[:, np.newaxis]
    moved, _ = dynamic_readings(unit, found(recording() * gain), GOOD)
    assert moved["dynamic_ck_xx_s"].value == pytest.approx(float(truth[0]), rel=1e-6)


def integrated_at_the_bins(seed: int) -> ComplexArray:
    """Noise-free phasors whose bearing part is acceleration, integrated line by line."""
    rng = np.random.default_rng(seed)
    shape = (24, 2, FREQUENCY_HZ.size + 2)
    untapered = rng.normal(size=shape) + 1j * rng.normal(size=shape)
    shaft = np.zeros((24, 2, FREQUENCY_HZ.size), dtype=np.complex128)
    smeared = np.zeros_like(shaft)
    number = np.arange(1, FREQUENCY_HZ.size + 1)
    for offset, share in ((-1, -0.5), (0, 1.0), (1, -0.5)):
        part = share * untapered[..., 1 + offset : 1 + offset + number.size]
        shaft += part
        smeared += part * ((number + offset) / number) ** 2
    omega = 2.0 * np.pi * FREQUENCY_HZ
    film = STIFFNESS[..., np.newaxis] + 1j * omega * DAMPING[..., np.newaxis]
    bearing = np.einsum("ijl,sjl->sil", film, smeared)
    bearing /= BRACKET.dynamic_stiffness_n_per_m(FREQUENCY_HZ)
    return np.concatenate([shaft, bearing], axis=1)


def test_constant_coefficients_fit_and_a_film_that_changes_with_frequency_does_not(recording):
    phasors = recording(bearing_um=0.01)
    stiffening = phasors.copy()
    stiffening[:, 2:] *= 1.0 + 0.02 * FREQUENCY_HZ

    assert np.all(np.abs(found(phasors).lack_of_fit - 1.0) < 0.4)
    assert np.all(found(stiffening).lack_of_fit > 2.0)


def test_loud_lines_and_runout_on_the_harmonics_do_not_spoil_what_quiet_lines_know(recording):
    phasors = recording(bearing_um=0.3)
    clean = found(phasors)
    for harmonic in range(1, 9):
        line = round(harmonic * TURN_HZ[0] / BIN_HZ) - 1
        phasors[:, :2, line - 1 : line + 2] += np.array([-0.5, 1.0, -0.5]) * 20.0 / harmonic

    runout = found(phasors)

    # Lines near the runout are left out, which costs precision but nothing else.
    assert runout.frequency_hz.size < clean.frequency_hz.size
    np.testing.assert_allclose(
        runout.k_n_per_m, clean.k_n_per_m, atol=3.0 * float(clean.std[:, :2].max())
    )

    phasors = recording(bearing_um=0.01)
    rng = np.random.default_rng(8)
    phasors[:, 2:, :40] += 5.0 * hann_noise(rng, 24, 2)[..., :40]  # below 3 Hz

    spoilt = found(phasors)

    np.testing.assert_allclose(spoilt.k_n_per_m, STIFFNESS, atol=0.005 * STIFFNESS[0, 0])


def test_noise_alone_or_motion_along_one_line_is_insufficient_and_never_a_stiffness(recording):
    for seed in range(30):
        noise = averaged(recording(seed, motion_um=0.0, probe_um=0.1, bearing_um=0.3))
        result = dynamic_stiffness(noise, BRACKET, TURN_HZ, DynamicSettings())
        assert result is Reason.INSUFFICIENT_EXCITATION
    phasors = recording(bearing_um=0.1)
    phasors[:, 1] = 0.5 * phasors[:, 0]
    result = dynamic_stiffness(averaged(phasors), BRACKET, TURN_HZ, DynamicSettings())
    assert result is Reason.INSUFFICIENT_EXCITATION


@pytest.mark.parametrize("channel", range(4))
def test_a_dead_channel_is_never_a_stiffness(recording, channel):
    phasors = recording(probe_um=0.01, bearing_um=0.1)
    phasors[:, channel] = 0.0
    result = dynamic_stiffness(averaged(phasors), BRACKET, TURN_HZ, DynamicSettings())
    assert result is Reason.INSUFFICIENT_EXCITATION


@pytest.mark.parametrize(
    "stricter",
    [{"min_signal_share": 0.999}, {"max_relative_uncertainty": 1e-4}, {"min_coherence": 0.9999}],
)
def test_each_demand_on_the_evidence_can_refuse_alone(recording, stricter):
    spectrum = averaged(recording(probe_um=0.1, bearing_um=0.1))
    base = DynamicSettings()

    assert isinstance(dynamic_stiffness(spectrum, BRACKET, TURN_HZ, base), DynamicStiffness)
    strict = replace(base, **stricter)
    result = dynamic_stiffness(spectrum, BRACKET, TURN_HZ, strict)
    assert result is Reason.INSUFFICIENT_EXCITATION


def test_fewer_lines_than_unknowns_or_gaps_in_a_spectrum_give_a_reason(recording):
    spectrum = averaged(recording(bearing_um=0.1))
    few = DynamicSettings(band_hz=(2.0, 2.5))
    assert dynamic_stiffness(spectrum, BRACKET, TURN_HZ, few) is Reason.INSUFFICIENT_EXCITATION

    spectrum.matrix[100:103], spectrum.power[100:103] = np.nan, np.nan
    result = dynamic_stiffness(spectrum, BRACKET, TURN_HZ, DynamicSettings())
    assert result is Reason.INSUFFICIENT_EXCITATION


def test_lines_that_do_not_show_what_lags_leave_it_to_the_stated_uncertainty(recording):
    """In a narrow band lagging parts cannot be told from stiffness and damping."""
    narrow = replace(NOISE_FREE, band_hz=(2.0, 4.0), min_segments=4)

    wide, found_narrow = (
        [found(recording(seed, bearing_um=0.05), settings) for seed in range(20)]
        for settings in (NOISE_FREE, narrow)
    )

    for each in found_narrow:
        error = np.abs(each.k_n_per_m - STIFFNESS)
        stated = np.hypot(each.std, each.model / np.sqrt(3.0))[:, :2]
        assert np.all(error < 4.0 * stated)
    left = np.mean([each.model for each in found_narrow]), np.mean([each.model for each in wide])
    assert left[0] > 1.5 * left[1]


def test_a_film_of_negative_damping_is_no_number(recording):
    backwards = recording(bearing_um=0.05).conj()  # of K − iωC, as the bracket has no damping
    result = found(backwards, DynamicSettings())
    assert np.all(np.diag(result.coefficients[:, 2:]) < 0.0)
    bearing = Bearing("UJB", 1.18e9, "ux", "uy", "vx", "vy", 500.0, (2000.0, 2000.0))
    at_lines = {
        name: missing(Reason.NO_VORTEX)
        for estimator in TRANSFERS.values()
        for axes in ("xx", "yy")
        for name in ESTIMATORS[estimator].names(axes)
    }

    of_film, _ = dynamic_readings(bearing, result, GOOD)
    readings = signs_checked(of_film | at_lines)

    for row in DYNAMIC_COEFFICIENTS:
        assert [readings[name] for name in row] == [missing(Reason.POLARITY)] * 4


def test_bearings_fitted_together_have_the_films_that_each_has_alone(recording):
    """With other lines, another or an unknown mass, another speed, and one without a film."""
    rng = np.random.default_rng(5)
    line = recording(seed=2, bearing_um=0.3)
    line[:, :, 60] *= 30.0  # leaks into its neighbours, which are not used
    still = 1e-3 * hann_noise(rng, 24, 4)
    heavier = replace(BRACKET, mass_kg=0.6e5, damping_n_s_per_m=1e5)
    measured = [
        FilmSpectrum(averaged(recording(seed=1, bearing_um=0.3)), BRACKET, TURN_HZ),
        FilmSpectrum(averaged(line), heavier, TURN_HZ),
        FilmSpectrum(averaged(still), BRACKET, TURN_HZ),
        FilmSpectrum(averaged(line), replace(BRACKET, mass_kg=None), TURN_HZ, (1, 0)),
        FilmSpectrum(averaged(recording(seed=3, n_segments=8)), BRACKET, (1.5, 1.55)),
        FilmSpectrum(averaged(recording(n_segments=3)), BRACKET, TURN_HZ),
    ]

    together = films(measured, DynamicSettings())

    assert together[2] is Reason.INSUFFICIENT_EXCITATION
    assert together[5] is Reason.FEW_SEGMENTS
    for place in (0, 1, 3, 4):
        [alone], found = films([measured[place]], DynamicSettings()), together[place]
        assert isinstance(alone, DynamicStiffness)
        assert isinstance(found, DynamicStiffness)
        for name, value in vars(alone).items():
            np.testing.assert_allclose(getattr(found, name), value, rtol=1e-10)
    assert len({found.frequency_hz.size for found in together[:2]}) == 2


def test_what_lags_in_a_constant_film_is_chance_and_in_the_stated_uncertainty(recording):
    films_found = [
        found(recording(seed, probe_um=0.1, bearing_um=0.3), DynamicSettings())
        for seed in range(60)
    ]

    assert np.sqrt((rms_z(films_found) ** 2).mean()) == pytest.approx(1.0, abs=0.1)
    errors = [each.k_n_per_m - STIFFNESS for each in films_found]
    std = np.mean([each.std[:, :2] for each in films_found], axis=0)
    assert np.all(np.abs(np.mean(errors, axis=0)) < 4.0 * std / np.sqrt(60))
    # the prior of the lagging parts adds little beside what the spectra show
    assert np.all(np.mean([each.model[:, :2] for each in films_found], axis=0) < std)
