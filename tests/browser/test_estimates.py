"""Estimators side by side, the film's matrices, and the budget of every uncertainty on request."""

import json
import re

from on_screen import A_NUMBER, DATA_MS, assert_fits, tab_to
from playwright.async_api import Page, Request, Route, expect

BEARING = "#/units/U1/bearings/UJB"
A_SPREAD = re.compile(r"± \d")
PREFERRED = "stiffness_xx_n_per_m"
SPREAD = f".tiles [data-reading={PREFERRED}] button.spread"
SAVED_BUDGET = f"**/budgets/{PREFERRED}"

ROWS = ("dynamic", "transfer_order1", "transfer_vortex", "ratio_order1", "ratio_vortex")
MATCHES = "selector => document.activeElement.matches(selector)"


async def open_bearing(page: Page, url: str) -> None:
    await page.goto(url + BEARING)
    await expect(page.locator(SPREAD)).to_have_text(A_SPREAD, timeout=DATA_MS)


async def freeze_budget(page: Page, url: str) -> dict:
    """Let the page hear one real budget again and again."""
    answer = await page.request.get(f"{url}api/v1/units/U1/bearings/UJB/budgets/{PREFERRED}")
    body = await answer.body()

    async def replay(route: Route) -> None:
        await route.fulfill(body=body, content_type="application/json")

    await page.route(SAVED_BUDGET, replay)
    return json.loads(body)


def gn_per_m(value: float) -> str:
    return f"{value / 1e9:.5f} GN/m"


async def test_a_budget_opens_by_keyboard_and_is_that_of_the_api(
    running_plant, page, picture_of, complaints_of
) -> None:
    complaints = complaints_of(page)
    await open_bearing(page, running_plant.url)
    budget = await freeze_budget(page, running_plant.url)
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
    await picture_of(page, "budget")
    await tab_to(page, MATCHES, ".closing")
    await page.keyboard.press("Enter")
    await expect(shown).to_be_hidden()
    await expect(page.locator(SPREAD)).to_be_focused()
    assert complaints == []


async def test_a_closed_budget_asks_nothing(running_plant, page) -> None:
    asked: list[str] = []

    def note(request: Request) -> None:
        if "/budgets/" in request.url:
            asked.append(request.url)

    page.on("request", note)
    await page.clock.install()
    await open_bearing(page, running_plant.url)
    assert asked == []
    await page.locator(SPREAD).click()
    await expect(page.locator(".tiles .budget tbody tr").first).to_be_visible()
    async with page.expect_request(SAVED_BUDGET):  # it asks again while it is open
        await page.clock.run_for(6000)
    await page.locator(SPREAD).click()
    before = len(asked)
    async with page.expect_request("**/api/v1/overview"):
        await page.clock.run_for(30_000)
    assert len(asked) == before


async def test_a_budget_that_cannot_be_had_says_why(running_plant, page) -> None:
    await open_bearing(page, running_plant.url)
    problem = {"title": "No result", "status": 409, "detail": "no number just now"}

    async def refuse(route: Route) -> None:
        body = json.dumps(problem)
        await route.fulfill(status=409, body=body, content_type="application/problem+json")

    await page.locator(SPREAD).click()
    await expect(page.locator(".tiles .budget tbody tr").first).to_be_visible()
    await page.route(SAVED_BUDGET, refuse)
    sentence = page.locator(".tiles .budget .sentence")
    await expect(sentence).to_have_text("No budget now. No number just now.", timeout=DATA_MS)
    await expect(page.locator(".tiles .budget table")).to_be_hidden()


async def test_all_estimators_stand_side_by_side_and_the_preferred_one_is_named(
    running_plant, page
) -> None:
    await open_bearing(page, running_plant.url)
    rows = page.locator(".estimators [data-estimator]")
    found = [await row.get_attribute("data-estimator") for row in await rows.all()]
    assert found == list(ROWS)
    dynamic = page.locator("[data-estimator=dynamic]")
    await expect(dynamic.locator("th")).to_have_text("dynamic preferred", timeout=DATA_MS)
    for name in ("dynamic_k_xx_n_per_m", "dynamic_c_yy_n_s_per_m"):
        number = page.locator(f".film [data-reading={name}] .number")
        await expect(number).to_have_text(A_NUMBER)
    await expect(page.locator(".film [data-reading=dynamic_n_lines] .number")).to_have_text(
        A_NUMBER
    )


async def test_an_estimator_without_excitation_says_so_in_its_row(running_plant, page) -> None:
    await open_bearing(page, running_plant.url)
    answer = await page.request.get(f"{running_plant.url}api/v1/overview")
    overview = await answer.json()
    readings = overview["units"][0]["bearings"][0]["readings"]
    for name in readings:
        if name.startswith("dynamic_"):
            readings[name] |= {
                "value": None,
                "level": "bad",
                "reason": "insufficient_excitation",
                "uncertainty": None,
            }

    async def replay(route: Route) -> None:
        await route.fulfill(json=overview)

    await page.route("**/api/v1/overview", replay)
    quality = page.locator("[data-estimator=dynamic] .mark")
    await expect(quality).to_have_text("No value: not enough excitation")
    for place in ("[data-estimator=dynamic]", ".film"):
        for number in await page.locator(f"{place} [data-reading] .number").all():
            await expect(number).to_have_text("—")
        await expect(page.locator(f"{place} .spread:visible")).to_have_count(0)


async def test_eccentricity_has_a_budget_too_and_only_one_budget_is_open(
    running_plant, page
) -> None:
    await open_bearing(page, running_plant.url)
    await page.locator(SPREAD).click()
    other = page.locator(".tiles [data-reading=eccentricity_ratio] button.spread")
    await other.click()
    shown = page.locator(".tiles .budget")
    await expect(shown).to_have_attribute("data-quantity", "eccentricity_ratio")
    await expect(shown.locator("tbody")).to_contain_text("clearance")
    await expect(page.locator(SPREAD)).to_have_attribute("aria-expanded", "false")
    await expect(other).to_have_attribute("aria-expanded", "true")


async def test_the_stiffness_trend_draws_random_uncertainty_apart_and_says_so(
    running_plant, page
) -> None:
    await open_bearing(page, running_plant.url)
    figure = page.locator("[data-chart=stiffness-trend]")
    await expect(figure.get_by_role("radio", name="Preferred")).to_be_checked()
    caption = figure.locator("figcaption")
    await expect(caption).to_contain_text("Dotted: random uncertainty", timeout=DATA_MS)
    drawn = "node => node.querySelector('.js-plotly-plot, .chart').data.map(t => t.meta ?? t.name)"
    traces = await figure.evaluate(drawn)
    assert traces.count("random") == 2
    await figure.get_by_role("radio", name="Eq. (5), vortex").check()
    await expect(figure.locator(".sentence")).to_be_hidden()


async def test_an_open_budget_fits_a_phone(running_plant, phone_page, picture_of) -> None:
    await open_bearing(phone_page, running_plant.url)
    await phone_page.locator(".estimators button.spread:visible").first.click()
    await expect(phone_page.locator(".estimators .budget tbody tr").first).to_be_visible()
    await assert_fits(phone_page)
    await picture_of(phone_page, "budget")
