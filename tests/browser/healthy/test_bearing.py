"""The page of a bearing: its charts, keyboard, estimators, and the budget of any uncertainty."""

import asyncio
import json
import re

from on_screen import CHARTS, await_charts, tab_to
from playwright.async_api import Page, Route, expect

BEARING = "#/units/U1/bearings/UJB"
SAYS = "wanted => (document.activeElement.value || document.activeElement.textContent) === wanted"
A_SPREAD = re.compile(r"± \d")
PREFERRED = "stiffness_xx_n_per_m"
SPREAD = f".tiles [data-reading={PREFERRED}] button.spread"
SAVED_BUDGET = f"**/budgets/{PREFERRED}"
MATCHES = "selector => document.activeElement.matches(selector)"
DRAWN = "node => node.querySelector('.js-plotly-plot, .chart').data.map(t => t.meta ?? t.name)"


async def open_bearing(page: Page, url: str) -> None:
    await page.goto(url + BEARING)
    await expect(page.locator(SPREAD)).to_have_text(A_SPREAD)


def gn_per_m(value: float) -> str:
    return f"{value / 1e9:.5f} GN/m"


async def test_every_chart_comes_from_the_plant_and_says_what_it_shows(plant, page, complaints):
    asked = []
    page.on("request", lambda request: asked.append(request.url))
    await page.goto(plant.url + BEARING)
    await await_charts(page)
    for name in CHARTS:
        caption = page.locator(f"[data-chart={name}] figcaption")
        await expect(caption).to_be_visible()
        assert len(await caption.inner_text()) > 20
        await expect(page.locator(f"[data-chart={name}] .sentence")).to_be_hidden()

    trend = page.locator("[data-chart=stiffness-trend]")
    await expect(trend.get_by_role("radio", name="Preferred")).to_be_checked()
    caption = trend.locator("figcaption")
    await expect(caption).to_contain_text("Dotted: random uncertainty")
    assert (await trend.evaluate(DRAWN)).count("random") == 2
    await trend.get_by_role("radio", name="Eq. (5), vortex").check()
    await expect(trend.locator(".sentence")).to_be_hidden()

    for words in ("1 y", "Vortex", "0–25 Hz"):
        await page.get_by_role("radio", name=words, exact=True).check()
    await expect(page.locator("[data-chart=spectrum] .chart .xtick").last).to_contain_text("25")
    assert all(url.startswith((plant.url, "data:", "blob:")) for url in asked)
    assert complaints == []


async def test_the_numbers_do_not_wait_for_the_chart_library(plant, page):
    is_let = asyncio.Event()

    async def hold(route: Route) -> None:
        await is_let.wait()
        await route.continue_()

    await page.route("**/plotly.min.js", hold)
    await open_bearing(page, plant.url)
    assert await page.locator(".chart path.js-line").count() == 0
    is_let.set()
    await await_charts(page)


async def test_the_keyboard_leads_from_the_plant_to_a_unit_its_bearing_and_its_charts(plant, page):
    await page.goto(plant.url)
    await page.get_by_role("link", name="Unit 1").focus()
    await page.keyboard.press("Enter")
    await expect(page.locator("h1")).to_contain_text("Unit 1")
    await tab_to(page, SAYS, "UJB")
    await page.keyboard.press("Enter")
    await expect(page.locator("h1")).to_contain_text(", UJB")
    await tab_to(page, SAYS, "900")
    await page.keyboard.press("ArrowRight")
    await expect(page.locator(".choices").get_by_role("radio", name="1 h")).to_be_checked()


async def test_an_unknown_unit_or_bearing_is_named_and_leads_back(plant, page):
    for address, sentence in (
        ("#/units/U9", "This plant has no unit U9."),
        ("#/units/U1/bearings/XYZ", "This plant has no bearing XYZ on a unit U1."),
    ):
        await page.goto(plant.url + address)
        await expect(page.get_by_text(sentence)).to_be_visible()
        await page.locator("main").get_by_role("link", name="Overview").click()
        await expect(page.locator("[data-bearing=UJB]")).to_be_visible()


async def test_a_budget_opens_by_keyboard_and_is_that_of_the_api(plant, page, complaints):
    await open_bearing(page, plant.url)
    answer = await page.request.get(f"{plant.url}api/v1/units/U1/bearings/UJB/budgets/{PREFERRED}")
    budget = await answer.json()
    await page.route(SAVED_BUDGET, lambda route: route.fulfill(json=budget))
    await tab_to(page, MATCHES, SPREAD)
    await page.keyboard.press("Enter")
    shown = page.locator(".tiles .budget")
    rows = shown.locator("tbody tr")
    await expect(rows).to_have_count(len(budget["lines"]))
    for row, line in zip(await rows.all(), budget["lines"], strict=True):
        name, kind, distribution, _, contribution = await row.locator("th, td").all_inner_texts()
        assert (name, kind, distribution) == (line["name"], line["kind"], line["distribution"])
        assert contribution == gn_per_m(line["contribution"])
    contributions = [line["contribution"] for line in budget["lines"]]
    assert contributions == sorted(contributions, reverse=True)
    await expect(shown.locator(".sentence")).to_contain_text(
        f"random {gn_per_m(budget['uncertainty']['random'])}, "
        f"systematic {gn_per_m(budget['uncertainty']['systematic'])}"
    )
    await expect(page.locator(SPREAD)).to_have_attribute("aria-expanded", "true")
    await tab_to(page, MATCHES, ".closing")
    await page.keyboard.press("Enter")
    await expect(shown).to_be_hidden()
    await expect(page.locator(SPREAD)).to_be_focused()
    assert complaints == []


async def test_a_closed_budget_asks_nothing(plant, browser):
    page = await browser.new_page()  # its clock is that of all pages of its context
    asked: list[str] = []
    page.on("request", lambda request: "/budgets/" in request.url and asked.append(request.url))
    await page.clock.install()
    await open_bearing(page, plant.url)
    assert asked == []
    await page.locator(SPREAD).click()
    await expect(page.locator(".tiles .budget tbody tr").first).to_be_visible()
    async with page.expect_request(SAVED_BUDGET):  # it asks again while it is open
        await page.clock.run_for(6000)
    await page.locator(SPREAD).click()
    before = len(asked)
    async with page.expect_request("**/api/v1/overview*"):
        await page.clock.run_for(30_000)
    assert len(asked) == before
    await page.close()


async def test_one_budget_is_open_at_a_time_and_one_that_cannot_be_had_says_why(plant, page):
    await open_bearing(page, plant.url)
    shown = page.locator(".tiles .budget")
    other = page.locator(".tiles [data-reading=eccentricity_ratio] button.spread")
    await page.locator(SPREAD).click()
    await other.click()
    await expect(shown).to_have_attribute("data-quantity", "eccentricity_ratio")
    await expect(shown.locator("tbody")).to_contain_text("clearance")
    await expect(page.locator(SPREAD)).to_have_attribute("aria-expanded", "false")
    await expect(other).to_have_attribute("aria-expanded", "true")

    await page.locator(SPREAD).click()
    await expect(shown).to_have_attribute("data-quantity", PREFERRED)
    await expect(shown.locator("tbody tr").first).to_be_visible()
    body = json.dumps({"title": "No result", "status": 409, "detail": "no number just now"})

    async def refuse(route: Route) -> None:
        await route.fulfill(status=409, body=body, content_type="application/problem+json")

    await page.route(SAVED_BUDGET, refuse)
    sentence = shown.locator(".sentence")
    await expect(sentence).to_have_text("No budget now. No number just now.")
    await expect(shown.locator("table")).to_be_hidden()
