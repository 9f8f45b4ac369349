"""The pages as such: charts, console, keyboard, narrow screens."""

import pytest
from on_screen import A_NUMBER, DATA_MS, assert_fits, tab_to
from playwright.async_api import Page, expect

BEARING = "#/units/U1/bearings/UJB"
CHARTS = ("stiffness-trend", "amplitude-trend", "orbit", "centre", "spectrum")
SAYS = "wanted => (document.activeElement.value || document.activeElement.textContent) === wanted"


async def await_charts(page: Page) -> None:
    for name in CHARTS:
        curve = page.locator(f"[data-chart={name}] .chart path.js-line").first
        await expect(curve).to_be_attached(timeout=DATA_MS)


async def test_every_chart_of_a_running_machine_is_drawn_and_says_what_it_shows(
    running_plant, page
) -> None:
    await page.goto(running_plant.url + BEARING)
    await await_charts(page)
    for name in CHARTS:
        caption = page.locator(f"[data-chart={name}] figcaption")
        await expect(caption).to_be_visible()
        assert len(await caption.inner_text()) > 20
        await expect(page.locator(f"[data-chart={name}] .sentence")).to_be_hidden()


async def test_no_page_complains_in_the_console(running_plant, page, complaints_of) -> None:
    complaints = complaints_of(page)
    await page.goto(running_plant.url)
    await expect(page.locator("[data-bearing=UJB]")).to_be_visible()
    await page.locator("[data-bearing=UJB] a").click()
    await await_charts(page)
    for words in ("1 y", "Vortex", "0–25 Hz"):
        await page.get_by_role("radio", name=words, exact=True).check()
    await expect(page.locator("[data-chart=spectrum] .chart .xtick").last).to_contain_text("25")
    assert complaints == []


@pytest.mark.parametrize("address", ["", BEARING])
async def test_a_phone_never_scrolls_sideways(
    running_plant, phone_page, picture_of, address
) -> None:
    await phone_page.goto(running_plant.url + address)
    await expect(phone_page.locator(".number").first).to_have_text(A_NUMBER, timeout=DATA_MS)
    if address:
        await await_charts(phone_page)
    await assert_fits(phone_page)
    await picture_of(phone_page, "bearing" if address else "overview")


async def test_an_operator_needs_no_mouse(running_plant, page) -> None:
    await page.goto(running_plant.url)
    await expect(page.locator("[data-bearing=UJB]")).to_be_visible()
    await tab_to(page, SAYS, "UJB")
    await page.keyboard.press("Enter")
    await expect(page.locator("h1")).to_contain_text("UJB")
    await tab_to(page, SAYS, "900")
    await page.keyboard.press("ArrowRight")
    await expect(page.get_by_role("radio", name="1 h")).to_be_checked()


async def test_an_unknown_bearing_is_named_and_leads_back(running_plant, page) -> None:
    await page.goto(running_plant.url + "#/units/U1/bearings/XYZ")
    sentence = page.get_by_text("This plant has no bearing XYZ on a unit U1.")
    await expect(sentence).to_be_visible()
    await page.get_by_role("link", name="Overview").click()
    await expect(page.locator("[data-bearing=UJB]")).to_be_visible()


async def test_the_page_loads_nothing_from_anywhere_else(running_plant, page) -> None:
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    await page.goto(running_plant.url + BEARING)
    await await_charts(page)
    assert all(url.startswith((running_plant.url, "data:", "blob:")) for url in asked)
