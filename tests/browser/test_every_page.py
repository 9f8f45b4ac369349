"""What holds for every page there is: no complaint, a title, phone width, light and dark."""

import json
from pathlib import Path

import pytest
from on_screen import DATA_MS, assert_fits, number_with
from playwright.async_api import Page, expect

AXE = Path(__file__).parent / "javascript" / "node_modules" / "axe-core" / "axe.min.js"
SEGMENTS = {":unit": "U1", ":bearing": "UJB"}

PATTERNS = "import('/static/pages.js').then(({ PAGES }) => PAGES.map(({ pattern }) => pattern))"
WAITING = "Asking the service."
BAND = "getComputedStyle(document.body).backgroundColor"
CHECK = "axe.run(document, { rules: { 'target-size': { enabled: true } } })"
REDRAWN = """before =>
    document.querySelector('[data-chart=spectrum] .chart path.xgrid').style.stroke !== before"""
GRAVE = ("serious", "critical")


async def addresses(page: Page, url: str) -> list[str]:
    await page.goto(url)
    patterns = await page.evaluate(PATTERNS)
    assert len(patterns) >= 4
    for segment, name in SEGMENTS.items():
        patterns = [pattern.replace(segment, name) for pattern in patterns]
    assert not any("/:" in address for address in patterns), patterns
    return patterns


async def settled(page: Page) -> None:
    """Wait until a page has had the answers that it opens with."""
    await expect(page.locator("#service")).to_contain_text("Service answered", timeout=DATA_MS)
    await expect(page.locator("#main").get_by_role("heading").first).to_be_attached()
    waiting = page.locator("#main").get_by_text(WAITING).filter(visible=True)
    await expect(waiting).to_have_count(0, timeout=DATA_MS)


async def test_every_page_opens_without_a_complaint_and_under_a_title_of_its_own(
    running_plant, page, complaints_of, picture_of
) -> None:
    complaints = complaints_of(page)
    titles = set()
    pages = await addresses(page, running_plant.url)
    for address in pages:
        await page.goto(running_plant.url + address)
        await settled(page)
        titles.add(await page.title())
        await picture_of(page, "-".join(address.split("/")[1:]) or "overview")
        assert complaints == [], address
    assert len(titles) == len(pages)


async def test_no_page_scrolls_sideways_on_a_phone(running_plant, phone_page, picture_of) -> None:
    for address in await addresses(phone_page, running_plant.url):
        await phone_page.goto(running_plant.url + address)
        await settled(phone_page)
        await assert_fits(phone_page)
        await picture_of(phone_page, "-".join(address.split("/")[1:]) or "overview")


async def test_no_page_shuts_anybody_out_in_light_or_in_dark(running_plant, page) -> None:
    if not AXE.is_file():
        pytest.skip("axe-core is not there: `make axe` fetches it, where npm is installed")
    for address in await addresses(page, running_plant.url):
        await page.goto(running_plant.url + address)
        await settled(page)
        await page.evaluate(AXE.read_text())
        for scheme in ("light", "dark"):
            await page.emulate_media(color_scheme=scheme)
            await expect(page.locator(f"html[data-theme={scheme}]")).to_be_attached()
            found = (await page.evaluate(CHECK))["violations"]
            grave = [each for each in found if each["impact"] in GRAVE]
            told = [(one["id"], [node["html"] for node in one["nodes"]]) for one in grave]
            assert not grave, f"{address}, {scheme}: {json.dumps(told, indent=1)}"


async def test_the_look_follows_the_system_until_somebody_chooses_and_is_remembered(
    running_plant, page, picture_of
) -> None:
    await page.emulate_media(color_scheme="dark")
    await page.goto(running_plant.url + "#/units/U1/bearings/UJB")
    dark = await page.evaluate(BAND)
    await page.get_by_label("Look").select_option("light")
    light = await page.evaluate(BAND)
    assert light != dark
    await page.reload()
    assert await page.evaluate(BAND) == light
    grid = page.locator("[data-chart=spectrum] .chart path.xgrid").first
    await expect(grid).to_be_attached(timeout=DATA_MS)
    stroke = "node => node.style.stroke"
    drawn = await grid.evaluate(stroke)
    await page.get_by_label("Look").select_option("system")
    assert await page.evaluate(BAND) == dark
    await page.wait_for_function(REDRAWN, arg=drawn)
    await picture_of(page, "dark")


async def test_amplitudes_are_shown_zero_to_peak_or_twice_that_as_chosen(
    running_plant, page
) -> None:
    await page.goto(running_plant.url + "#/units/U1/bearings/UJB")
    shaft = page.locator("[data-reading=order1_shaft_x_um_pk]")
    before = await number_with(shaft, "µm pk")
    await page.get_by_label("Amplitudes").select_option("pp")
    after = await number_with(shaft, "µm pk-pk")
    assert after / before == pytest.approx(2.0, rel=0.1)  # the machine lives on in between
    chart = page.locator("[data-chart=amplitude-trend] .ytitle")
    await expect(chart).to_have_text("µm pk-pk", timeout=DATA_MS)
    await page.reload()
    await expect(shaft.locator(".suffix")).to_have_text("µm pk-pk", timeout=DATA_MS)
