"""Films against their baselines on the dashboard: verdict, map, versions, and what engineers do."""

import re

import pytest
from on_screen import assert_fits
from playwright.async_api import Page, expect

FILM = "#/units/U1/bearings/UJB/film"
BEARING = "#/units/U1/bearings/UJB"
PLOTS = ("against-eccentricity_ratio", "against-oil_temperature_c")
DATA_MS = 90_000
WORDS = re.compile(
    "Normal|Alert|Danger|Gathering evidence|No baseline|Not enough excitation|Reading doubted"
    "|Not settled"
)


async def await_charts(page: Page) -> None:
    tiles = page.locator("[data-chart=baseline-map] .heatmaplayer image").first
    await expect(tiles).to_be_attached(timeout=DATA_MS)
    for name in PLOTS:
        point = page.locator(f"[data-chart={name}] .chart path.point").first
        await expect(point).to_be_attached(timeout=DATA_MS)


async def test_a_film_is_told_in_words_and_its_charts_say_what_they_show(
    living_plant, page, picture_of, complaints_of
) -> None:
    complaints = complaints_of(page)
    await page.goto(living_plant.url + FILM)
    await await_charts(page)

    for direction in ("x", "y"):
        row = page.locator(f".verdict[data-direction={direction}]")
        await expect(row.locator(".mark")).to_contain_text(WORDS, timeout=DATA_MS)
        await expect(row.locator("svg.shape")).to_be_visible()
    await expect(page.locator(".film-facts")).to_contain_text("cell: eccentricity")
    await expect(page.locator(".film-facts")).to_contain_text("compared with baseline version 1")
    for name in ("baseline-map", *PLOTS):
        caption = page.locator(f"[data-chart={name}] figcaption")
        assert len(await caption.inner_text()) > 40
    await expect(page.locator("[data-chart=baseline-map] figcaption")).to_contain_text(
        "borrowed from around"
    )
    await page.get_by_role("radio", name="y", exact=True).check()
    await expect(page.locator("[data-chart=baseline-map] figcaption")).to_contain_text(
        "direction y"
    )
    await picture_of(page, "film")
    assert complaints == []


async def test_a_trend_that_reaches_into_a_simulated_past_says_so(living_plant, page) -> None:
    await page.goto(living_plant.url + BEARING)
    await page.get_by_role("radio", name="30 d", exact=True).check()

    caption = page.locator("[data-chart=stiffness-trend] figcaption")

    await expect(caption).to_contain_text("are simulated, not measured", timeout=DATA_MS)


async def test_an_engineer_freezes_a_baseline_and_thaws_it_without_a_mouse(
    living_plant, page
) -> None:
    await page.goto(living_plant.url + FILM)
    version = page.locator("[data-version='1']")
    await expect(version).to_have_attribute("data-status", "in_force", timeout=DATA_MS)

    await page.get_by_role("button", name="Freeze…").focus()
    await page.keyboard.press("Enter")
    await page.keyboard.type("before the overhaul")
    await page.keyboard.press("Enter")
    await expect(page.get_by_role("alert").filter(has_text="Give your name first.")).to_be_visible()
    await expect(page.locator("#actor")).to_be_focused()
    await page.keyboard.type("A. Name")
    await page.get_by_role("button", name="Freeze", exact=True).focus()
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


async def test_what_is_refused_is_said_in_a_sentence(living_plant, page) -> None:
    await page.goto(living_plant.url + FILM)
    await expect(page.locator("[data-version='1']")).to_be_visible(timeout=DATA_MS)
    await page.get_by_label("Your name").fill("A. Name")
    await page.get_by_role("button", name="Renew after a machine event…").click()
    await page.get_by_label("When the event was over").fill("2999-01-01T00:00")
    await page.get_by_label("Why").fill("overhaul")
    await page.get_by_role("button", name="Renew", exact=True).click()

    await expect(page.get_by_role("alert").filter(has_text="future")).to_be_visible()
    await expect(page.locator("[data-version='1']")).to_have_attribute("data-status", "in_force")


async def test_overview_and_bearing_page_have_the_verdict_and_lead_to_the_film(
    living_plant, page, picture_of
) -> None:
    await page.goto(living_plant.url)
    brief = page.locator("[data-bearing=UJB] .film-brief .mark").first
    await expect(brief).to_contain_text(WORDS, timeout=DATA_MS)
    await picture_of(page, "overview")
    await page.locator("[data-bearing=UJB] a").click()
    await expect(page.locator(".film-verdict .mark").first).to_contain_text(WORDS)
    await page.get_by_role("link", name="Baseline, map and history").click()
    await expect(page.locator("h1")).to_contain_text("film against its baseline")


async def test_a_film_that_is_not_watched_says_why_in_place_of_every_chart(
    running_plant, page, complaints_of
) -> None:
    complaints = complaints_of(page)
    await page.goto(running_plant.url + FILM)
    why = "This film is not watched: operating states need power_channel and rated_power_mw."

    await expect(page.locator(".film-verdict .sentence")).to_have_text(why)
    for name in ("baseline-map", *PLOTS):
        await expect(page.locator(f"[data-chart={name}] .sentence")).to_have_text(why)
    await page.goto(running_plant.url)
    await expect(page.locator("[data-bearing=UJB] .film-brief")).to_have_text("Not watched")
    assert complaints == []


@pytest.mark.parametrize("address", [FILM, BEARING])
async def test_films_fit_a_phone(living_plant, phone_page, picture_of, address) -> None:
    await phone_page.goto(living_plant.url + address)
    await expect(phone_page.locator(".verdict .mark").first).to_contain_text(WORDS, timeout=DATA_MS)
    if address == FILM:
        await await_charts(phone_page)
    await assert_fits(phone_page)
    await picture_of(phone_page, "film" if address == FILM else "bearing")
