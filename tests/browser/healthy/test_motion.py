"""Spectra over time and the orbit player, as engineers use them."""

import re

import pytest
from on_screen import FILES, await_orbit, await_spectra
from playwright.async_api import expect

SPECTRA = "#/units/U1/bearings/UJB/waterfall"
ORBITS = "#/units/U1/bearings/UJB/orbits"
TWO_FRAMES = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
AT = "() => Number(document.querySelector('#orbit-at').value)"
HAS_MOVED = "(at) => Number(document.querySelector('#orbit-at').value) !== at"
ZOOMED_IN = """() => Plotly.relayout(
  document.querySelector("[data-chart=waterfall] .chart"), { "yaxis.autorange": true },
)"""

MAGENTA = [194, 24, 143]
COLOURED = """(wanted) => {
  const canvas = document.querySelector("canvas.orbit-canvas");
  const dots = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  let found = 0;
  for (let at = 0; at < dots.length; at += 4) {
    found += dots[at + 3] > 200 && wanted.every((part, n) => Math.abs(dots[at + n] - part) < 40);
  }
  return found;
}"""
ARROW = """async ([files, sense]) => {
  const { orbitPicture } = await import(`${files}charts/orbit_picture.js`);
  const n = 301; // the newest sample is a third of a turn, of 100 samples, beyond the x axis
  const angle = (at) => sense * 2 * Math.PI * ((at - 266) / 100);
  const trace = (of) => Array.from({ length: n }, (_, at) => 30 * of(angle(at)));
  const [shaft_x_um, shaft_y_um] = [trace(Math.cos), trace(Math.sin)];
  const clip = {
    startS: 0, rate_hz: 100, n_samples: n, turnS: 1, mark: null, clearance_um: 100, centre_um: null,
    shaft_x_um, shaft_y_um, order1: { shaft_x_um, shaft_y_um },
  };
  let turned = 0;
  const rotate = CanvasRenderingContext2D.prototype.rotate;
  CanvasRenderingContext2D.prototype.rotate = function (by) { turned = by; };
  const picture = orbitPicture();
  document.body.append(picture.node);
  picture.draw(clip, 3, { turns: 1, whole: false, alone: true, inClearance: false });
  CanvasRenderingContext2D.prototype.rotate = rotate;
  return [Math.cos(turned), -Math.sin(turned)];
}"""


async def test_spectra_over_time_are_a_map_or_lines_and_a_moment_is_chosen_by_key_or_click(
    plant, page, complaints
):
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


async def test_a_cursor_has_harmonics_and_the_address_holds_what_is_chosen(plant, page, complaints):
    await page.goto(f"{plant.url}{SPECTRA}?axis=cpm&picture=lines")
    cursor, rows = page.get_by_label("Cursor"), page.locator(".readings").first.locator("tbody tr")
    await expect(page.get_by_role("radio", name="cpm", exact=True)).to_be_checked()
    await expect(page.locator("[data-chart=full-spectrum] .xtitle")).to_contain_text("forward")
    await expect(page.locator(".cursor .hint")).to_contain_text("Hann window")
    await cursor.fill("92.3")
    await cursor.press("Enter")

    await expect(rows).to_have_count(6)
    await expect(rows.nth(1)).to_contain_text("184.6")
    await cursor.press("ArrowUp")  # to the next line, the 11th of 600 / 4096 Hz
    await expect(rows.first).to_contain_text("96.7")
    await page.get_by_role("radio", name="× speed", exact=True).check()
    await expect(cursor).to_have_value(re.compile(r"^1\.04"))
    await page.reload()
    await expect(page.get_by_role("radio", name="× speed", exact=True)).to_be_checked()
    await expect(page.get_by_role("radio", name="Lines", exact=True)).to_be_checked()
    await expect(rows).to_have_count(6)
    await page.get_by_role("button", name="No cursor").click()
    await expect(rows).to_have_count(0)
    assert "cursor" not in page.url
    assert complaints == []


async def test_a_map_has_the_colours_of_its_legend(plant, page):
    await page.goto(plant.url + SPECTRA)
    await await_spectra(page)
    chart = page.locator("[data-chart=waterfall] .chart")
    strokes = "paths => paths.map((path) => getComputedStyle(path).stroke)"
    drawn = await chart.locator(".scatterlayer path.js-line").evaluate_all(strokes)
    assert drawn
    assert set(drawn) == set(
        await chart.locator(".legend path.legendlines, .legend .js-line").evaluate_all(strokes)
    )


async def test_an_orbit_plays_pauses_and_steps_by_keyboard(plant, page, complaints):
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


@pytest.mark.long
async def test_a_turn_is_held_as_reference_and_the_address_holds_what_is_drawn(
    plant, page, complaints
):
    await page.goto(f"{plant.url}{ORBITS}?motion=alone")
    await await_orbit(page)
    await expect(page.get_by_role("radio", name="To fit", exact=True)).to_be_checked()
    await expect(page.get_by_role("radio", name="1× alone", exact=True)).to_be_checked()
    await page.keyboard.press("Space")
    hold = page.get_by_role("button", name="Hold as reference")
    without = await page.evaluate(COLOURED, MAGENTA)
    await hold.click()
    await expect(hold).to_have_attribute("aria-pressed", "true")
    await expect(page.locator(".player .hint").last).to_contain_text("Dotted: the reference")
    assert await page.evaluate(COLOURED, MAGENTA) > without == 0
    await hold.click()
    assert await page.evaluate(COLOURED, MAGENTA) == 0
    await page.get_by_role("radio", name="In the clearance", exact=True).check()
    assert page.url.endswith("/orbits?motion=alone&frame=clearance")
    assert [words for words in complaints if "willReadFrequently" not in words] == []  # the test's


@pytest.mark.long
async def test_an_arrow_points_the_way_the_shaft_runs(plant, page):
    await page.goto(plant.url)
    ways = [await page.evaluate(ARROW, [FILES, sense]) for sense in (1, -1)]
    assert ways[0] == pytest.approx([0.0, 1.0], abs=0.15)  # up, on the right: from x to y
    assert ways[1] == pytest.approx([0.0, -1.0], abs=0.15)


async def test_every_transducer_of_the_bearing_has_its_waveform(plant, page):
    await page.goto(plant.url + ORBITS)
    answer = await page.request.get(f"{plant.url}api/v1/units/U1/channels")
    found = (await answer.json())["waveform"]
    ours = [one for one in found if any(use.startswith("UJB ") for use in one["used_by"])]
    wanted = [one["settings"]["id"] for one in ours]
    chart = page.locator("[data-chart=waveforms] .chart")
    await expect(chart.locator(".annotation-text")).to_have_text(wanted)
    await expect(chart.locator("path.js-line")).to_have_count(len(wanted))
    await expect(chart.locator(".ytitle").first).to_have_text("µm")


async def test_all_pages_of_a_bearing_have_the_same_ways(plant, page):
    seen = []
    for here in ("", "/film", "/waterfall", "/orbits"):
        await page.goto(f"{plant.url}#/units/U1/bearings/UJB{here}")
        head = page.locator(".bearing-head")
        await expect(head.locator(".siblings a")).to_have_count(5)
        seen.append(await head.locator(".ways a").all_inner_texts())
        await expect(head.locator(".siblings [aria-current]")).to_have_text("UJB")
        await expect(head.locator(".ways [aria-current]")).to_have_count(1)
    assert seen == [["Bearing", "Film", "Spectra over time", "Orbit player", "Trends"]] * 4


@pytest.mark.long
async def test_nothing_moves_by_itself_for_those_who_asked_for_less_motion(plant, page):
    await page.emulate_media(reduced_motion="reduce")
    await page.goto(plant.url + ORBITS)
    await await_orbit(page)

    await expect(page.locator(".player .play")).to_contain_text("Play")
    at = await page.evaluate(AT)
    await page.evaluate(TWO_FRAMES)
    assert await page.evaluate(AT) == at
