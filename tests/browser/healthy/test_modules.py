"""Modules of the dashboard: run without a page, and loaded in one script, again or offline."""

import numpy as np
import pytest
from on_screen import FILES
from playwright.async_api import Request, Route, expect

EMPTY = FILES[1:] + "padwatch.svg"
"""A page of the plant that runs nothing by itself."""

CALL = f"""
async ([module, name, ...given]) => (await import(`{FILES}${{module}}.js`))[name](...given)
"""

DRAWN_WITHOUT_A_SIZE = """async (files) => {
  const { orbitPicture } = await import(`${files}charts/orbit_picture.js`);
  const trace = [1, 2, 3];
  const clip = {
    startS: 0, rate_hz: 1, n_samples: 3, turnS: 1, mark: [], order1: null,
    shaft_x_um: trace, shaft_y_um: trace, clearance_um: 100, centre_um: [0, 0],
  };
  orbitPicture().draw(clip, 2, { turns: 1, whole: true, alone: false, inClearance: true });
}"""

STIFFNESS = "stiffness_xx_n_per_m"
CONNECTED = {"state": "connected", "reason": None, "data_age_s": 0.2}
DRIFT = {"kind": "clock_drift", "level": "alert", "is_active": True, "value": 300.0}
DRIFT |= {"limit": 200.0, "value_unit": "ppm"}
SILENT = {"state": "not_connected", "reason": "daq:502: no reply within 0.5 s"}
OTHER = SILENT | {"reason": "daq:502: wrong device: vendor is 'A', expected 'B'"}
NAMELESS = SILENT | {"reason": "daq:502: no name server answered within 1.0 s"}
UNKNOWN = SILENT | {"reason": "daq:502: [Errno -3] Temporary failure in name resolution"}


async def test_an_alarm_leads_to_where_most_is_told_about_it(plant, page):
    await page.goto(plant.url + EMPTY)
    bearing = ("order1_shaft_x", "zone_bearing_y", "oil_temperature", "gap_x", "opposite_gap_y")
    alarms = [("film_stiffness", "UJB"), ("channel_not_ok", "a"), ("link_lost", "link")]
    alarms += [("pad_temperature", "ujb_pad_1"), *((kind, "UJB") for kind in bearing)]
    told = [{"unit": "U1", "subject": subject, "kind": kind} for kind, subject in alarms]
    found = [await page.evaluate(CALL, ["alarm_place", "alarmPlace", alarm]) for alarm in told]
    place = "#/units/U1/bearings/UJB"
    unit = "#/units/U1"
    assert found == [f"{place}/film", unit, "#/sources", unit, *([place] * len(bearing))]
    at = {"operating_state": "full_load", "eccentricity_ratio": 0.37, "attitude_deg": None}
    raised = {"raised_at": at | {"oil_temperature_c": 46.2}}
    words = await page.evaluate(CALL, ["alarm_words", "raisedWords", raised])
    assert words == "full load, eccentricity 0.37, oil 46.2 °C"


async def test_an_alarm_says_its_directions_and_what_it_waits_for(plant, page):
    await page.goto(plant.url + EMPTY)
    film = {"kind": "film_stiffness", "directions": "xy", "waits_for": "danger"}
    gap = {"kind": "gap_x", "directions": "", "waits_for": "normal"}
    for alarm, what, waits in (
        (film, "Film stiffness changed, x and y", "Danger once it is certain and has lasted"),
        (film | {"directions": "y"}, "Film stiffness changed, y", None),
        (gap, "Probe gap x", "Returns if it lasts for its delay"),
        (gap | {"waits_for": "alert"}, "Probe gap x", "Eases to alert if it lasts for its delay"),
        (gap | {"waits_for": None}, "Probe gap x", ""),
    ):
        assert await page.evaluate(CALL, ["alarm_words", "whatWords", alarm]) == what
        if waits is not None:
            assert await page.evaluate(CALL, ["alarm_words", "waitWords", alarm]) == waits


async def test_before_and_after_are_told_in_words_and_a_broken_chain_is_seen(plant, page):
    await page.goto(plant.url + EMPTY)
    shelved = {
        "action": "alarm.shelved",
        "object": "U1:UJB:order1_shaft_x",
        "before": {"state": "unacknowledged", "level": "alert"},
        "after": {"state": "shelved", "level": "alert", "until_ns": None},
    }
    where = await page.evaluate(CALL, ["audit_words", "objectWords", shelved])
    assert where == "U1 UJB: Shaft vibration 1×, x"
    changes = await page.evaluate(CALL, ["audit_words", "changeLines", shelved])
    assert changes == ["state: unacknowledged → shelved"]
    chain = [
        {"chain": "access", "number": 3, "hash": "c", "previous_hash": "b"},
        {"chain": "padwatch", "number": 2, "hash": "z", "previous_hash": "y"},
        {"chain": "access", "number": 2, "hash": "b", "previous_hash": "a"},
        {"chain": "access", "number": 1, "hash": "a", "previous_hash": "0"},
    ]
    broken = [*chain[:2], chain[2] | {"hash": "x"}, chain[3]]
    for entries, look in ((chain, "good"), ([chain[0], chain[3]], "absent"), (broken, "bad")):
        found = await page.evaluate(CALL, ["audit_words", "chainWords", entries])
        assert found["look"] == look


async def test_a_wrong_sign_is_never_good_and_names_the_channels(plant, page):
    await page.goto(plant.url + EMPTY)
    good = {"quality": {"level": "good", "reason": "ok"}, "readings": {}, "bad_reasons": []}
    for signs, level in (([], "good"), (["b_shaft_x", "b_bearing_x"], "uncertain")):
        latest = good | {"doubtful_signs": signs}
        found = await page.evaluate(CALL, ["words", "qualityOf", latest])
        assert found["level"] == level
    assert found["words"] == "check the sign of b_shaft_x or b_bearing_x"


async def test_a_verdict_says_since_when_and_in_which_directions(plant, page):
    await page.goto(plant.url + EMPTY)
    alarm = {"is_active": True, "raised": "2026-01-01T10:00:00Z", "value": -12.0}
    alarm |= {"level": "danger", "kind": "film_stiffness", "condition_reason": "film_changed"}
    alert = {"level": "alert", "raised": "2026-01-02T10:00:00Z"}
    film = {"why_not": "no baseline", "x": None, "y": {"change_percent": 5.0}}
    for alarms, look, said in [
        ([alarm | {"directions": "x"}], "danger", "film softer in x (cause: film)"),
        ([alarm | {"directions": "xy"}], "danger", "film x softer, y stiffer (cause: film)"),
        ([alarm | alert | {"directions": "y"}], "alert", "film stiffer in y (cause: film)"),
        ([alarm | {"directions": "x", "is_active": False}], "quiet", "Not watched"),
        (None, "quiet", "Not watched"),
    ]:
        found = await page.evaluate(CALL, ["verdict_words", "bearingVerdict", film, alarms])
        assert found[0] == look
        assert found[1].endswith(said), found
    words = {"verdict": "danger", "level": "danger", "change_percent": -12.4}
    words |= {"deviation_percent": -29.8, "stiffness_n_per_m": 0.231e9, "expected_n_per_m": 0.33e9}
    confirmed = await page.evaluate(
        CALL, ["verdict_words", "confirmedWords", {"x": words, "y": None}]
    )
    assert confirmed == "x expected 0.330 GN/m; confirmed −12 %"
    now = await page.evaluate(CALL, ["film_words", "nowSentence", words])
    assert now == "Now 0.231, expected 0.330 GN/m (−29.8 %)."
    ratio = words | dict.fromkeys(("stiffness_n_per_m", "expected_n_per_m"))
    ratio |= {"stiffness_of_kb": 0.41, "expected_of_kb": 0.584}
    now = await page.evaluate(CALL, ["film_words", "nowSentence", ratio])
    assert now == "Now 0.410, expected 0.584 k_b (−29.8 %)."
    unknown = {"value": None, "level": "bad", "reason": "bracket_unknown", "uncertainty": None}
    known = unknown | {"value": 0.41, "level": "good", "reason": "ok"}
    latest = {"readings": {"stiffness_xx_n_per_m": unknown, "stiffness_xx_of_kb": known}}
    found = await page.evaluate(CALL, ["parts/reading", "readingOf", latest, STIFFNESS])
    assert (found["name"], found["value"]) == ("stiffness_xx_of_kb", 0.41)
    ahead = words | {"verdict": "normal", "level": None}
    limits = {"alert_percent": 3.5, "danger_percent": 15.0}
    film = {"why_not": None, "limits": limits, "x": ahead, "y": ahead}
    found = await page.evaluate(CALL, ["verdict_words", "bearingVerdict", film, []])
    assert found[:2] == ["quiet", "Change not confirmed yet"]  # never normal at −30 %


async def test_the_worst_about_a_source_is_told_with_what_to_do(plant, page):
    await page.goto(plant.url + EMPTY)
    for changes, alarms, lost, rank, look, said in [
        (NAMELESS, [], 0, 0, "bad", "name of the device"),
        (UNKNOWN, [], 0, 0, "bad", "name of the device"),
        (SILENT, [], 0, 0, "bad", "switched on"),
        (OTHER, [], 0, 0, "bad", "Another device"),
        ({"data_age_s": 12.0}, [DRIFT], 0, 1, "bad", "still samples"),
        ({"state": "unknown"}, [], 0, 1, "bad", ""),
        ({"state": "connecting"}, [], 0, 2, "uncertain", "Wait"),
        ({}, [DRIFT], 700, 3, "uncertain", "sampling rate"),
        ({}, [], 700, 4, "uncertain", "network"),
        ({"state": "ended"}, [], 0, 5, "absent", ""),
        ({}, [], 0, 9, "good", ""),
    ]:
        found = await page.evaluate(
            CALL, ["source_words", "troubleOf", CONNECTED | changes, alarms, lost]
        )
        assert (found["rank"], found["look"]) == (rank, look), found
        assert said in found["advice"]


async def test_peaks_and_harmonics_are_read_between_the_lines_of_a_hann_window(plant, page):
    await page.goto(plant.url + EMPTY)
    n, bin_hz = 4096, 0.1
    at = np.arange(n) / n
    tones = {15.383: 30.0, 30.766: 4.0, 77.5: 2.0}  # in bins, the last one midway
    wave = sum(um * np.cos(2.0 * np.pi * bins * at + bins) for bins, um in tones.items())
    tapered = np.fft.rfft(wave * (1.0 - np.cos(2.0 * np.pi * at)))
    amplitude = np.abs(2.0 / n * tapered[1:201]) + 0.01
    lines = [(bin_hz * np.arange(1, 201)).tolist(), amplitude.tolist()]

    peaks = await page.evaluate(CALL, ["charts/spectrum_reading", "peaksOf", *lines, 0.2])
    harmonics = await page.evaluate(CALL, ["charts/spectrum_reading", "harmonicsOf", *lines, 1.538])

    for (bins, um), peak in zip(tones.items(), peaks, strict=True):
        assert peak["hz"] == pytest.approx(bins * bin_hz, abs=0.005 * bin_hz)
        assert peak["um"] == pytest.approx(um, rel=0.01)
    assert [one["um"] for one in harmonics][:2] == pytest.approx([30.0, 4.0], rel=0.01)
    assert [one["hz"] for one in harmonics] == pytest.approx([1.538 * k for k in range(1, 7)])
    orders = await page.evaluate(CALL, ["charts/spectrum_reading", "peaksOf", *lines, 2.0])
    assert len(orders) == 2  # no peak below where it is looked for


async def test_an_orbit_may_be_drawn_before_its_place_on_the_page_has_a_size(plant, page):
    await page.goto(plant.url)
    await page.evaluate(DRAWN_WITHOUT_A_SIZE, FILES)


async def test_the_first_screen_needs_two_scripts_and_no_chart_library(plant, page):
    asked: list[str] = []

    def note(request: Request) -> None:
        if request.resource_type in ("script", "stylesheet"):
            asked.append(request.url.rpartition("/")[2])

    page.on("request", note)
    await page.goto(plant.url)
    await expect(page.locator("#service")).to_contain_text("Connected")
    assert sorted(asked) == ["all.css", "all.js", "recover.js"]


async def test_a_page_whose_script_did_not_load_loads_itself_again(plant, page):
    failed: list[Route] = []

    async def fail(route: Route) -> None:
        failed.append(route)
        await route.fulfill(status=404)

    await page.route("**/all.js", fail, times=1)
    await page.goto(plant.url)

    await expect(page.locator("#service")).to_contain_text("Connected")
    assert len(failed) == 1


async def test_the_reference_of_the_api_needs_no_other_site(plant, page, complaints):
    elsewhere: list[str] = []

    def note(request: Request) -> None:
        if not request.url.startswith((plant.url, "data:")):
            elsewhere.append(request.url)

    page.on("request", note)
    await page.goto(plant.url + "docs")
    await expect(page.locator(".info .title")).to_contain_text("padwatch")
    await page.get_by_role("button", name="GET /api/v1/overview").first.click()
    await page.get_by_role("button", name="Try it out").click()
    await page.get_by_role("button", name="Execute").click()
    await expect(page.locator(".responses-table.live-responses-table")).to_contain_text("200")
    assert elsewhere == []
    assert complaints == []


@pytest.mark.long
async def test_browsers_that_open_the_page_at_once_all_show_it(plant, browser):
    contexts = [await browser.new_context() for _ in range(4)]
    pages = [await context.new_page() for context in contexts]
    for page in pages:
        await page.goto(plant.url, wait_until="commit")
    for page in pages:
        await expect(page.locator("#service")).to_contain_text("Connected")
    for context in contexts:
        await context.close()
