"""Spectra over time: what was in the samples stands in them; wrong questions are refused."""

import sqlite3
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from rigs.blocks import given_block

from core.monitor.assessment import Assessment
from core.monitor.monitor import UnitMonitor
from core.quality import GOOD, Reading
from core.spectra.cross_spectrum import CrossSpectrum
from core.units import NS_PER_S
from service.api.routes.spectra import MAX_NUMBERS
from service.runtime.times import rfc3339
from service.settings.core_values import analysis_of, machine_of
from service.settings.plant import PlantFile

SPECTRA = "/api/v1/units/U1/bearings/UJB/spectra"
DAY = {"start": "2026-01-01T00:00:00Z", "end": "2026-01-02T00:00:00Z"}
T0_S = 1_767_225_600
LINE, TONE_UM = 70, 37.0


@pytest.fixture(scope="session")
def toned(plant: PlantFile) -> list[Assessment]:
    """Of a shaft that moves in x with 37 µm at line 70, besides 100 µm at running speed."""
    unit, settings = machine_of(plant.unit[0]), analysis_of(plant.analysis)
    n = settings.segment_samples + 11 * settings.hop_samples
    turns = np.arange(n) / unit.rate_hz * 92.3 / 60.0
    samples = np.full((len(unit.channels), n), 2000.0)
    ids = [channel.id for channel in unit.channels]
    samples[[ids.index("ujb_shaft_x"), ids.index("ujb_shaft_y")]] += 100.0 * np.sin(
        2.0 * np.pi * turns
    )
    samples[ids.index("ujb_shaft_x")] += TONE_UM * np.sin(
        2.0 * np.pi * LINE * np.arange(n) / settings.segment_samples
    )
    monitor = UnitMonitor(unit, settings)
    return list(
        monitor.steps(
            given_block(
                unit=unit.id,
                epoch=1,
                first_index=0,
                start_ns=T0_S * 1_000_000_000,
                rate_hz=unit.rate_hz,
                samples=samples.astype(np.float32),
                channel_quality=(GOOD,) * len(unit.channels),
                slow={
                    **{channel.id: Reading(45.0) for channel in plant.unit[0].slow_channel},
                    "speed": Reading(92.3),
                    "active_power": Reading(350.0),
                },
            )
        )
    )


async def test_a_line_appears_in_place_with_its_amplitude_up_to_the_frequency_asked(service, toned):
    service.store.append(toned, [])

    body = await service.json(SPECTRA, **DAY, channel=["shaft_x", "shaft_y"])

    frequency_hz = np.array(body["frequency_hz"])
    assert frequency_hz[LINE - 1] == pytest.approx(LINE * 600.0 / 8192.0, rel=1e-12)
    assert set(body["channels"]) == {"shaft_x", "shaft_y"}
    assert body["n_found"] == len(body["time"]) == 3
    for row in body["channels"]["shaft_x"]["amplitude"]:
        assert row[LINE - 1] == pytest.approx(TONE_UM, rel=5e-4)
        beyond = np.flatnonzero((np.array(row) > 1.0) & (frequency_hz > 2.0))
        assert beyond.tolist() == [LINE - 2, LINE - 1, LINE]  # the taper's width
    assert max(body["channels"]["shaft_y"]["amplitude"][0][LINE - 3 : LINE + 2]) < 0.1
    assert body["speed_rpm"] == [92.3] * 3
    assert body["order1_hz"] == pytest.approx([92.3 / 60.0] * 3)
    assert body["power_mw"] == [350.0] * 3
    assert body["duration_s"][0] == pytest.approx(8192 / 600.0)

    low = await service.json(SPECTRA, **DAY, channel="shaft_x", max_frequency_hz=3.0)

    assert 2.9 < low["frequency_hz"][-1] <= 3.0
    assert len(low["channels"]["shaft_x"]["amplitude"][0]) == len(low["frequency_hz"])


async def test_a_kept_spectrum_is_the_one_that_was_shown_then(service, running, assessments):
    of_bearing = [each for each in assessments if each.bearing == "UJB"]
    service.live.set_assessment(of_bearing[0])
    then = await service.json(SPECTRA.replace("spectra", "spectrum"))

    body = await running.json(SPECTRA, **DAY)

    assert body["time"][0] == rfc3339(of_bearing[0].time_ns)
    assert body["frequency_hz"] == pytest.approx(then["frequency_hz"])
    assert body["order1_hz"][0] == then["lines"]["order1"]
    assert set(body["channels"]) == set(then["channels"])
    for name, shown in then["channels"].items():
        row = body["channels"][name]["amplitude"][0]
        assert row == pytest.approx(shown["amplitude"], rel=2e-4, abs=1e-5)
    quality = of_bearing[0].readings["order1_bearing_y_um_pk"].quality
    assert (body["level"][0], body["reason"][0]) == (quality.level.name.lower(), quality.reason)


async def test_nothing_kept_is_no_spectra_and_says_when_the_first_was(read_only):
    before = {"start": "2025-01-01T00:00:00Z", "end": "2025-02-01T00:00:00Z"}
    early = await read_only.json(SPECTRA, **before)
    assert early["time"] == []
    assert early["first"].startswith("2026-01-01T00:00:13")
    body = await read_only.json(SPECTRA.replace("U1", "U2"), **DAY)

    assert (body["time"], body["frequency_hz"], body["first"]) == ([], [], None)
    assert set(body["channels"]) == {"shaft_x", "shaft_y", "bearing_x", "bearing_y"}
    assert [each["amplitude"] for each in body["channels"].values()] == [[]] * 4


async def test_a_channel_that_was_lost_has_null_for_a_spectrum(service, toned):
    n_segments = toned[0].spectrum.n_segments.copy()
    n_segments[1] = n_segments[:, 1] = 0
    lost = replace(toned[0], spectrum=replace(toned[0].spectrum, n_segments=n_segments))
    service.store.append([lost], [])

    body = await service.json(SPECTRA, **DAY)

    assert body["channels"]["shaft_y"]["amplitude"] == [None]
    assert body["channels"]["shaft_x"]["amplitude"][0] is not None


async def test_spectra_of_an_earlier_set_up_are_counted_and_left_out(service, toned):
    half = CrossSpectrum(
        toned[0].spectrum.frequency_hz[::2],
        toned[0].spectrum.matrix[::2],
        toned[0].spectrum.power[::2],
        toned[0].spectrum.n_segments,
    )
    earlier = replace(toned[0], spectrum=half, time_ns=T0_S * 1_000_000_000)
    later = replace(toned[0], time_ns=(T0_S + 60) * 1_000_000_000)
    service.store.append([earlier, later], [])

    body = await service.json(SPECTRA, **DAY)

    assert (body["n_found"], body["n_other_resolution"]) == (2, 1)
    assert body["time"] == [rfc3339((T0_S + 60) * NS_PER_S)]


async def test_damage_is_told_with_its_time_and_the_rest_is_given(service, toned, tmp_path):
    service.store.append(toned, [])
    with closing(sqlite3.connect(tmp_path / "padwatch.sqlite3")) as connection:
        connection.execute(
            "UPDATE spectrum SET amplitudes = zeroblob(length(amplitudes))"
            " WHERE time_ns = (SELECT min(time_ns) FROM spectrum)"
        )
        connection.commit()

    body = await service.json(SPECTRA, **DAY)

    assert body["damaged"] == ["2026-01-01T00:00:13.653Z"]
    assert len(body["time"]) == 2


WRONG: list[tuple[dict[str, object], str]] = [
    ({"start": "2026-01-02T00:00:00Z", "end": "2026-01-01T00:00:00Z"}, "start"),
    ({"max_spectra": 1_000_000_000}, "max_spectra"),
    ({"max_spectra": 1}, "max_spectra"),
    ({"channel": "shaft_z"}, "channel"),
    ({"channel": ["shaft_x"] * 9}, "channel"),
    ({"max_frequency_hz": 0.0}, "max_frequency_hz"),
]


async def test_what_is_asked_wrongly_is_refused_by_name(read_only):
    for wrong, parameter in WRONG:
        problem = await read_only.problem(SPECTRA, 422, **{**DAY, **wrong})

        assert parameter in str(problem["errors"]) + problem["detail"]
    for known, unknown in (("UJB", "XJB"), ("U1", "U9")):
        await read_only.problem(SPECTRA.replace(known, unknown), 404, **DAY)


async def test_more_numbers_than_fit_an_answer_are_refused_before_they_are_written(service, toned):
    fine = np.arange(1.0, 1001.0) * 0.01
    power = np.zeros((1000, 4, 4))
    spectrum = CrossSpectrum(fine, power.astype(complex), power, toned[0].spectrum.n_segments)
    n = MAX_NUMBERS // 4000 + 1
    many = [
        replace(toned[0], spectrum=spectrum, time_ns=(T0_S + 60 * i) * 1_000_000_000)
        for i in range(n)
    ]
    service.store.append(many, [])

    problem = await service.problem(SPECTRA, 422, **DAY, max_spectra=1000)

    assert f"at most {MAX_NUMBERS // 4000} spectra" in problem["detail"]
    fewer = await service.json(SPECTRA, **DAY, max_spectra=1000, channel="shaft_x")
    assert len(fewer["time"]) == n
