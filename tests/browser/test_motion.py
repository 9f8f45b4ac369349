"""Spectra over time and the orbit player, as engineers use them."""

import re
import shutil
from pathlib import Path

import pytest
from on_screen import DATA_MS, assert_fits
from playwright.async_api import Page, expect

SPECTRA = "#/units/U1/bearings/UJB/waterfall"
ORBITS = "#/units/U1/bearings/UJB/orbits"
RECORDING = Path(__file__).parents[1] / "recordings" / "part_load"
TWO_FRAMES = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
SECOND_SPECTRUM = "() => Number(document.querySelector('#moment')?.max) > 0"
AT = "() => Number(document.querySelector('#orbit-at').value)"
HAS_MOVED = "(at) => Number(document.querySelector('#orbit-at').value) !== at"
ZOOMED_IN = """() => Plotly.relayout(
  document.querySelector("[data-chart=waterfall] .chart"), { "yaxis.autorange": true },
)"""
HAS_ORBIT = """() => {
  const canvas = document.querySelector("canvas.orbit-canvas");
  const dots = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  return dots.some((value) => value > 0);
}"""

DRAWN_WITHOUT_A_SIZE = """async () => {
  const { orbitPicture } = await import("/static/charts/orbit_picture.js");
  const trace = [1, 2, 3];
  const clip = {
    startS: 0, rate_hz: 1, n_samples: 3, turnS: 1, mark: [], order1: null,
    shaft_x_um: trace, shaft_y_um: trace, clearance_um: 100, centre_um: [0, 0],
  };
  orbitPicture().draw(clip, 2, { turns: 1, whole: true, alone: false, inClearance: true });
}"""


async def await_spectra(page: Page) -> None:
    chart = page.locator("[data-chart=waterfall] .chart")
    await expect(chart.locator(".heatmaplayer image").first).to_be_attached(timeout=DATA_MS)
    await page.wait_for_function(SECOND_SPECTRUM, timeout=DATA_MS)


async def await_orbit(page: Page) -> None:
    await expect(page.locator("canvas.orbit-canvas")).to_be_visible(timeout=DATA_MS)
    await page.wait_for_function(HAS_ORBIT, timeout=DATA_MS)


async def test_spectra_over_time_are_a_map_and_a_moment_is_chosen_by_keyboard(
    running_plant, page, complaints_of, picture_of
) -> None:
    complaints = complaints_of(page)
    await page.goto(running_plant.url + SPECTRA)
    await await_spectra(page)
    moment = page.locator("[data-chart=moment] figcaption")

    await expect(page.locator("[data-chart=waterfall] figcaption")).to_contain_text("spectra from")
    await expect(moment).to_contain_text("r/min")
    await expect(page.get_by_role("button", name="Newest")).to_be_disabled()
    newest = await moment.inner_text()
    await page.get_by_role("slider", name="Moment").focus()
    await page.keyboard.press("Home")

    await expect(moment).not_to_have_text(newest)
    await expect(page.get_by_role("button", name="Newest")).to_be_enabled()
    await picture_of(page, "map")
    assert complaints == []


async def test_spectra_are_drawn_as_lines_along_multiples_of_the_speed(
    running_plant, page, complaints_of, picture_of
) -> None:
    complaints = complaints_of(page)
    await page.goto(running_plant.url + SPECTRA)
    await await_spectra(page)
    chart = page.locator("[data-chart=waterfall] .chart")
    for words in ("Bearing x", "Lines", "× speed", "Linear", "All"):
        await page.get_by_role("radio", name=words, exact=True).check()

    await expect(chart.locator(".xtitle")).to_have_text("Multiple of the running speed")
    await expect(chart.locator(".heatmaplayer image")).to_have_count(0)
    await expect(chart.locator("path.js-line").first).to_be_attached()
    await picture_of(page, "lines")
    assert complaints == []


async def test_a_click_into_the_map_shows_the_spectrum_of_that_moment(running_plant, page) -> None:
    await page.goto(running_plant.url + SPECTRA)
    await await_spectra(page)
    words = page.locator("output[for=moment]")
    newest = await words.inner_text()
    await page.evaluate(ZOOMED_IN)
    box = await page.locator("[data-chart=waterfall] .nsewdrag").bounding_box()
    assert box is not None

    await page.mouse.move(box["x"] + box["width"] / 4, box["y"] + 0.9 * box["height"])
    await expect(page.locator("[data-chart=waterfall] .hovertext").first).to_be_attached()
    await page.mouse.down()
    await page.mouse.up()

    await expect(words).not_to_have_text(newest)


async def test_a_time_without_spectra_says_why_and_since_when_there_are_some(
    living_plant, page
) -> None:
    await page.goto(living_plant.url + SPECTRA)
    await await_spectra(page)
    sentence = page.locator("[data-chart=waterfall] .sentence")
    caption = page.locator("[data-chart=waterfall] figcaption")
    await expect(caption).to_contain_text("are simulated and have no spectra")

    for _ in range(2):
        await page.get_by_role("button", name="Earlier").click()

    await expect(sentence).to_contain_text("The oldest that is kept is of", timeout=DATA_MS)
    await expect(sentence).to_contain_text("is simulated: readings without spectra")
    await expect(page.locator("[data-chart=waterfall] .chart")).to_be_hidden()


async def test_an_orbit_plays_pauses_and_steps_by_keyboard(
    running_plant, page, complaints_of, picture_of
) -> None:
    complaints = complaints_of(page)
    await page.goto(running_plant.url + ORBITS)
    await await_orbit(page)
    play = page.locator(".player .play")

    await expect(play).to_contain_text("Pause")
    await page.wait_for_function(HAS_MOVED, arg=await page.evaluate(AT))
    await page.keyboard.press("Space")
    await expect(play).to_contain_text("Play")
    at = await page.evaluate(AT)
    await page.evaluate(TWO_FRAMES)
    assert await page.evaluate(AT) == at
    await page.keyboard.press("Shift+ArrowLeft")
    turn_s = at - await page.evaluate(AT)
    assert turn_s == pytest.approx(60.0 / 92.3, abs=0.01)
    await page.keyboard.press("ArrowRight")
    assert await page.evaluate(AT) - (at - turn_s) == pytest.approx(turn_s / 36.0, abs=0.002)
    await expect(page.locator(".player .facts")).to_contain_text(re.compile(r"µm pk, from x to y"))
    await picture_of(page, "live")
    assert complaints == []


async def test_nothing_moves_by_itself_for_those_who_asked_for_less_motion(
    running_plant, browser
) -> None:
    page = await browser.new_page(reduced_motion="reduce")
    await page.goto(running_plant.url + ORBITS)
    await await_orbit(page)

    await expect(page.locator(".player .play")).to_contain_text("Play")
    at = await page.evaluate(AT)
    await page.evaluate(TWO_FRAMES)
    assert await page.evaluate(AT) == at
    await page.close()


async def test_a_recording_is_played_although_its_unit_is_not_connected(
    new_plant, page, complaints_of, picture_of, tmp_path
) -> None:
    name = "U1-20260101T000000.000Z-order1_shaft_x"
    shutil.copytree(RECORDING, tmp_path / "var" / "demo" / "captures" / name)
    new_plant.start_service()
    complaints = complaints_of(page)
    await page.goto(new_plant.url + ORBITS)
    await expect(page.locator(".player .sentence")).to_contain_text("No sample of this unit")
    await expect(page.locator("#orbit-source option")).to_have_count(2, timeout=DATA_MS)
    await page.locator("#orbit-source").select_option(name)
    await await_orbit(page)

    await page.locator("#orbit-at").fill("50")
    await expect(page.locator(".player .facts")).to_contain_text("00:00:5", timeout=DATA_MS)
    await expect(page.locator(".player .facts")).to_contain_text("92.3")
    await picture_of(page, "recording")

    await page.reload()  # the address names the recording
    await await_orbit(page)
    await expect(page.locator("#orbit-source")).to_have_value(name)
    await expect(page.locator(".player .facts")).to_contain_text("2026-01-01 00:00:0")
    assert complaints == []


@pytest.mark.parametrize("address", [SPECTRA, ORBITS])
async def test_spectra_and_orbits_fit_a_phone(
    running_plant, phone_page, picture_of, address
) -> None:
    await phone_page.goto(running_plant.url + address)
    await (await_spectra if address == SPECTRA else await_orbit)(phone_page)

    await assert_fits(phone_page)
    await picture_of(phone_page, address.rpartition("/")[2])


async def test_the_last_motion_does_not_pass_for_the_present_one_when_the_link_is_lost(
    new_plant, page
) -> None:
    new_plant.start_daq()
    new_plant.start_service()
    await page.goto(new_plant.url + ORBITS)
    await await_orbit(page)
    new_plant.stop_daq()

    sentence = page.locator(".player .sentence")
    await expect(sentence).to_contain_text("not the present", timeout=DATA_MS)
    await expect(page.locator("canvas.orbit-canvas")).to_be_visible()


async def test_an_orbit_may_be_drawn_before_its_place_on_the_page_has_a_size(
    running_plant, page
) -> None:
    await page.goto(running_plant.url)
    await page.evaluate(DRAWN_WITHOUT_A_SIZE)
