"""Spectra over time and the orbit player, as engineers use them."""

import re

import pytest
from on_screen import await_orbit, await_spectra
from playwright.async_api import expect

SPECTRA = "#/units/U1/bearings/UJB/waterfall"
ORBITS = "#/units/U1/bearings/UJB/orbits"
TWO_FRAMES = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
AT = "() => Number(document.querySelector('#orbit-at').value)"
HAS_MOVED = "(at) => Number(document.querySelector('#orbit-at').value) !== at"
ZOOMED_IN = """() => Plotly.relayout(
  document.querySelector("[data-chart=waterfall] .chart"), { "yaxis.autorange": true },
)"""


async def test_spectra_over_time_are_a_map_or_lines_and_a_moment_is_chosen_by_key_or_click(
    plant, page, complaints
) -> None:
    await page.goto(plant.url + SPECTRA)
    await await_spectra(page)
    moment = page.locator("[data-chart=moment] figcaption")
    words = page.locator("output[for=moment]")
    await expect(page.locator("[data-chart=waterfall] figcaption")).to_contain_text("spectra from")
    await expect(moment).to_contain_text("r/min")
    await expect(page.get_by_role("button", name="Newest")).to_be_disabled()
    newest = await moment.inner_text()
    await page.get_by_role("slider", name="Moment").focus()
    await page.keyboard.press("Home")
    await expect(moment).not_to_have_text(newest)

    await page.get_by_role("button", name="Newest").click()
    await expect(page.get_by_role("button", name="Newest")).to_be_disabled()
    newest = await words.inner_text()
    await page.evaluate(ZOOMED_IN)
    box = await page.locator("[data-chart=waterfall] .nsewdrag").bounding_box()
    assert box is not None
    await page.mouse.move(box["x"] + box["width"] / 4, box["y"] + 0.9 * box["height"])
    await expect(page.locator("[data-chart=waterfall] .hovertext").first).to_be_attached()
    await page.mouse.down()
    await page.mouse.up()
    await expect(words).not_to_have_text(newest)
    await expect(page.get_by_role("button", name="Newest")).to_be_enabled()

    for choice in ("Bearing x", "Lines", "× speed", "Linear", "All"):
        await page.get_by_role("radio", name=choice, exact=True).check()
    chart = page.locator("[data-chart=waterfall] .chart")
    await expect(chart.locator(".xtitle")).to_have_text("Multiple of the running speed")
    await expect(chart.locator(".heatmaplayer image")).to_have_count(0)
    await expect(chart.locator("path.js-line").first).to_be_attached()
    assert complaints == []


async def test_a_cursor_has_harmonics_and_the_address_holds_what_is_chosen(
    plant, page, complaints
) -> None:
    await page.goto(f"{plant.url}{SPECTRA}?axis=cpm&picture=lines")
    cursor, rows = page.get_by_label("Cursor"), page.locator(".readings").first.locator("tbody tr")
    await expect(page.get_by_role("radio", name="cpm", exact=True)).to_be_checked()
    await expect(page.locator("[data-chart=full-spectrum] .xtitle")).to_contain_text("forward")
    await expect(page.locator(".cursor .hint")).to_contain_text("Hann window")
    await cursor.fill("92.3")
    await cursor.press("Enter")

    await expect(rows).to_have_count(6)
    await expect(rows.nth(1)).to_contain_text("184.6")
    await cursor.press("ArrowUp")  # by a line of 600 / 4096 Hz
    await expect(rows.first).to_contain_text("101.1")
    await page.get_by_role("radio", name="× speed", exact=True).check()
    await expect(cursor).to_have_value(re.compile(r"^1\.09"))
    await page.reload()
    await expect(page.get_by_role("radio", name="× speed", exact=True)).to_be_checked()
    await expect(page.get_by_role("radio", name="Lines", exact=True)).to_be_checked()
    await expect(rows).to_have_count(6)
    await page.get_by_role("button", name="No cursor").click()
    await expect(rows).to_have_count(0)
    assert "cursor" not in page.url
    assert complaints == []


async def test_a_map_has_the_colours_of_its_legend(plant, page) -> None:
    await page.goto(plant.url + SPECTRA)
    await await_spectra(page)
    chart = page.locator("[data-chart=waterfall] .chart")
    strokes = "paths => paths.map((path) => getComputedStyle(path).stroke)"
    drawn = await chart.locator(".scatterlayer path.js-line").evaluate_all(strokes)
    assert drawn
    assert set(drawn) == set(
        await chart.locator(".legend path.legendlines, .legend .js-line").evaluate_all(strokes)
    )


async def test_an_orbit_plays_pauses_and_steps_by_keyboard(plant, page, complaints) -> None:
    await page.goto(plant.url + ORBITS)
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
    assert complaints == []


async def test_nothing_moves_by_itself_for_those_who_asked_for_less_motion(plant, page) -> None:
    await page.emulate_media(reduced_motion="reduce")
    await page.goto(plant.url + ORBITS)
    await await_orbit(page)

    await expect(page.locator(".player .play")).to_contain_text("Play")
    at = await page.evaluate(AT)
    await page.evaluate(TWO_FRAMES)
    assert await page.evaluate(AT) == at
