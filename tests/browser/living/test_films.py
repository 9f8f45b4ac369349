"""Films against their baselines, the audit trail, bearings side by side, and pages on a phone."""

import copy
import re

import pytest
from on_screen import (
    A_NUMBER,
    FILES,
    assert_accessible,
    assert_fits,
    await_charts,
    await_spectra,
    freeze,
)
from playwright.async_api import Page, expect

FILM = "#/units/U1/bearings/UJB/film"
BEARING = "#/units/U1/bearings/UJB"
PLOTS = ("against-eccentricity_ratio", "against-oil_temperature_c")
WORDS = re.compile(
    "Normal|Alert|Danger|Gathering evidence|No baseline|Weak signal|Reading doubted"
    "|Not settled|Change not confirmed yet"
)


async def await_film_charts(page: Page) -> None:
    tiles = page.locator("[data-chart=baseline-map] .heatmaplayer image").first
    await expect(tiles).to_be_attached()
    for name in PLOTS:
        point = page.locator(f"[data-chart={name}] .chart path.point").first
        await expect(point).to_be_attached()


async def test_a_film_is_told_in_words_and_its_charts_say_what_they_show(plant, page, complaints):
    await page.goto(plant.url + FILM)
    await await_film_charts(page)

    for direction in ("x", "y"):
        row = page.locator(f".verdict[data-direction={direction}]")
        await expect(row.locator(".mark")).to_contain_text(WORDS)
        await expect(row.locator("svg.shape")).to_be_visible()
    await expect(page.locator(".film-facts")).to_contain_text("cell: eccentricity")
    await expect(page.locator(".film-facts")).to_contain_text("compared with baseline version 1")
    for name in ("baseline-map", *PLOTS):
        caption = page.locator(f"[data-chart={name}] figcaption")
        assert len(await caption.inner_text()) > 40
    await expect(page.locator("[data-chart=baseline-map] figcaption")).to_contain_text(
        "interpolated"
    )
    await page.get_by_role("radio", name="y", exact=True).check()
    await expect(page.locator("[data-chart=baseline-map] figcaption")).to_contain_text(
        "direction y"
    )
    assert complaints == []


async def test_an_engineer_freezes_and_thaws_by_keys_and_reads_what_is_refused(plant, page):
    await page.goto(plant.url + FILM)
    version = page.locator("[data-version='1']")
    await expect(version).to_have_attribute("data-status", "in_force")

    await page.get_by_role("button", name="Freeze…").focus()
    await page.keyboard.press("Enter")
    await page.keyboard.type("before the overhaul")
    await page.keyboard.press("Enter")  # refused by the browser without a name
    await expect(page.get_by_role("textbox", name="Your name")).to_be_focused()
    await page.keyboard.type("A. Name")
    await page.keyboard.press("Enter")

    await expect(version).to_contain_text("Frozen")
    step = page.locator("[data-step=frozen]").first
    await expect(step).to_contain_text("A. Name")
    await expect(step).to_contain_text("before the overhaul")
    await page.get_by_role("button", name="Thaw…").focus()
    await page.keyboard.press("Enter")
    await page.keyboard.press("Escape")
    await expect(page.get_by_role("button", name="Thaw…")).to_be_focused()
    await page.keyboard.press("Enter")
    await page.keyboard.type("the overhaul is put off")
    await page.keyboard.press("Enter")
    await expect(version).not_to_contain_text("Frozen")

    await page.get_by_role("button", name="Renew after a machine event…").click()
    await page.get_by_label("When the event was over").fill("2999-01-01T00:00")
    await page.get_by_label("Why").fill("overhaul")
    await page.get_by_role("button", name="Renew", exact=True).click()
    await expect(page.get_by_role("alert").filter(has_text="future")).to_be_visible()
    await expect(version).to_have_attribute("data-status", "in_force")


async def test_overview_and_bearing_page_have_the_verdict_and_lead_to_the_film(plant, page):
    await page.goto(plant.url)
    brief = page.locator("[data-bearing=UJB] .film-brief .mark").first
    await expect(brief).to_contain_text(WORDS)
    await page.locator("[data-bearing=UJB] a").click()
    await expect(page.locator(".film-verdict .mark").first).to_contain_text(WORDS)
    await page.locator(".choices").get_by_role("radio", name="30 d", exact=True).check()
    caption = page.locator("[data-chart=stiffness-trend] figcaption")
    await expect(caption).to_contain_text("are simulated, not measured")
    await page.get_by_role("link", name="Baseline, map and history").click()
    await expect(page.locator("h1")).to_contain_text("film against its baseline")


UNWELL = {"verdict": "danger", "level": "danger", "change_percent": -12.4}
UNWELL |= {"deviation_percent": -29.8, "stiffness_n_per_m": 0.231e9, "expected_n_per_m": 0.33e9}
ALARM = {"unit": "U2", "subject": "LJB", "level": "danger", "is_active": True, "value": -12.4}
ALARM |= {"raised": "2026-01-01T22:10:00Z", "condition_reason": "film_changed", "state": "normal"}
ALARM |= {"id": "U2:LJB:film_stiffness", "kind": "film_stiffness", "directions": "xy"}
ALARM |= {"is_acknowledged": False, "condition": "active", "value_unit": "%", "limit": -3.5}
ALARMS = {"alarms": [ALARM], "unjudged": []}
MAX_WORDS = 150
COUNT_WORDS = "document.body.innerText.split(/\\s+/).filter(Boolean).length"
LOOKS = "marks => marks.map((mark) => mark.dataset.look)"


def has_stiffness(overview: dict) -> bool:
    bearings = overview["units"][0]["bearings"]
    return all(one["readings"]["stiffness_xx_n_per_m"]["value"] for one in bearings)


async def test_the_first_screen_says_which_bearing_is_unwell_by_how_much_since_when_and_why(
    plant, page, phone_page
):
    for shown in (page, phone_page):
        overview = await freeze(shown, plant.url, has_stiffness)
        other = copy.deepcopy(overview["units"][0]) | {"id": "U2", "name": "Unit 2"}
        overview["units"].append(other)
        await shown.goto(plant.url)
        await expect(
            shown.locator("[data-unit=U2] [data-bearing=LJB] .film-brief")
        ).to_contain_text(WORDS)
        assert await shown.evaluate(COUNT_WORDS) <= MAX_WORDS
        film = other["bearings"][1]["film"]
        film |= {"x": film["x"] | UNWELL, "y": film["y"] | UNWELL}
        await shown.route("**/api/v1/alarms", lambda route: route.fulfill(json=ALARMS))
        await shown.goto(plant.url)
        row = shown.locator("[data-unit=U2] [data-bearing=LJB]")
        verdict = row.locator(".film-brief")
        await expect(verdict).to_contain_text("DANGER since 2026-01-0")
        await expect(verdict).to_contain_text("film softer, both directions (cause: film)")
        await expect(verdict).to_contain_text("expected 0.330 GN/m; confirmed −12 %")
        await expect(row.locator(".number").first).to_have_text("0.231")
        await expect(row.locator(".change")).to_contain_text("−30")
        for place in (verdict, row.locator(".change")):
            await expect(place).to_be_in_viewport(ratio=1.0)
        await expect(row.locator("th")).to_have_text("LJB lower guide")
        assert await shown.evaluate(COUNT_WORDS) <= MAX_WORDS
        verdicts = await shown.locator(".film-brief .mark").evaluate_all(LOOKS)
        data = await shown.locator(".quality .mark").evaluate_all(LOOKS)
        assert "danger" in verdicts
        assert not set(verdicts) & set(data)
        await assert_accessible(shown)
        await shown.goto(plant.url + BEARING)
        await expect(shown.locator(".verdict .mark").first).to_contain_text(WORDS)
        await assert_accessible(shown)


async def test_a_time_without_spectra_says_why_and_since_when_there_are_some(plant, page):
    await page.goto(plant.url + FILM.replace("film", "waterfall"))
    await await_spectra(page)
    sentence = page.locator("[data-chart=waterfall] .sentence")
    caption = page.locator("[data-chart=waterfall] figcaption")
    await expect(caption).to_contain_text("are simulated and have no spectra")

    for _ in range(2):
        await page.get_by_role("button", name="Earlier").click()

    await expect(sentence).to_contain_text("The oldest that is kept is of")
    await expect(sentence).to_contain_text("is simulated: readings without spectra")
    await expect(page.locator("[data-chart=waterfall] .chart")).to_be_hidden()


WIDEST = {
    BEARING: ".verdict .mark",
    f"{BEARING}/film": "[data-chart=baseline-map] .heatmaplayer image",
    "#/trends?b=U1/UJB&b=U1/LJB&q=stiffness_xx_n_per_m&q=speed_rpm&last=2592000": (
        "[data-chart=trend-film-stiffness-gn-m] .chart .scatterlayer .trace path.js-line"
    ),
}
HREFS = "links => links.map(link => link.getAttribute('href'))"
LEADS_SOMEWHERE = """
async ([files, addresses]) => {
  const { routeOf } = await import(`${files}route.js`);
  const { PAGES } = await import(`${files}pages.js`);
  return addresses.map((address) => routeOf(address, PAGES) !== null);
}
"""


async def test_the_trail_tells_what_the_service_wrote_and_keys_find_it(plant, page, complaints):
    told = await (await page.request.get(f"{plant.url}api/v1/audit?limit=100")).json()
    await page.goto(plant.url + "#/audit")
    rows = page.locator("[data-entry]")
    await expect(rows).to_have_count(len(told["entries"]))
    accepted = page.locator("[data-entry]", has_text="baseline accepted").first
    await expect(accepted).to_contain_text("in force: none → 1")
    await expect(accepted).to_contain_text(", version 1")
    await expect(page.locator(".page-head .mark")).to_have_attribute("data-look", "good")

    await page.get_by_label("To what").fill("service")
    await page.keyboard.press("Enter")
    await expect(page.locator("[data-entry]")).to_have_count(1)
    await expect(page.locator("[data-entry]")).to_contain_text("service started")
    await page.get_by_label("Who").fill("nobody of that name")
    await page.keyboard.press("Enter")
    await expect(page.get_by_text("No entry fits.")).to_be_visible()
    await page.get_by_role("button", name="Clear").press("Enter")
    await expect(page.locator("[data-entry]").nth(1)).to_be_visible()
    assert complaints == []


@pytest.mark.long
async def test_bearings_stand_side_by_side_with_the_numbers_of_the_service(plant, page, complaints):
    await page.goto(plant.url + "#/units/U1")
    table = page.get_by_role("table", name="side by side")
    oil = table.locator("[data-reading=oil_temperature_c] .number")
    await expect(oil).to_have_text([A_NUMBER] * 3)
    bearings = (await freeze(page, plant.url))["units"][0]["bearings"]
    await page.reload()
    oils = [bearing["readings"]["oil_temperature_c"]["value"] for bearing in bearings]
    await expect(oil).to_have_text([f"{value:.1f}" for value in oils])
    heads = await table.get_by_role("columnheader").all_inner_texts()
    assert heads == ["Quantity", "UJB upper guide", "LJB lower guide", "TJB turbine guide"]
    await expect(page.locator(".operating-state")).to_contain_text("oad")
    await expect(table.locator(".centre-picture").first).to_be_visible()
    await expect(table.locator(".film-brief .mark").first).to_be_visible()
    await expect(page.locator(".unit-alarms")).not_to_contain_text("Asking the service.")
    await expect(page.locator(".unit-recordings")).not_to_contain_text("Asking the service.")
    ways = await table.locator(".ways a").evaluate_all(HREFS)
    assert len(ways) == 15
    assert all(await page.evaluate(LEADS_SOMEWHERE, [FILES, ways]))
    assert complaints == []


@pytest.mark.long
async def test_films_and_trends_fit_a_phone(plant, phone_page):
    for address, widest in WIDEST.items():
        await phone_page.goto(plant.url + address)
        await expect(phone_page.locator(widest).first).to_be_attached()
        if address == BEARING:
            await await_charts(phone_page)
        await assert_fits(phone_page)
