"""A stopped DAQ, a stopped service: the page says so, and shows no number as current."""

import re

import pytest
from on_screen import A_NUMBER, DATA_MS
from playwright.async_api import Page, expect

BEARING = "#/units/U1/bearings/LJB"
STIFFNESS = "[data-reading=stiffness_xx_n_per_m] .number"

NO_NUMBER = """() => [...document.querySelectorAll('.number')].every(n => n.textContent === '—')
    && [...document.querySelectorAll('.spread')].every(n => n.hidden)
    && [...document.querySelectorAll('.interval')].every(n => n.textContent === '')"""

AGE_ABOVE = """limit => {
    const words = document.querySelector('.source .data-age').textContent;
    const [, minutes, seconds] = /Data age (?:(\\d+) min )?(\\d+) s/.exec(words);
    return 60 * Number(minutes ?? 0) + Number(seconds) > limit;
}"""


async def data_age_s(page: Page) -> int:
    words = await page.locator(".source .data-age").inner_text()
    minutes, seconds = re.fullmatch(r"Data age (?:(\d+) min )?(\d+) s", words).groups()
    return 60 * int(minutes or 0) + int(seconds)


@pytest.mark.long
async def test_a_stopped_daq_turns_age_and_quality_bad_and_takes_every_number_away(
    new_plant, page, picture_of
) -> None:
    new_plant.start_daq()
    new_plant.start_service()
    await page.goto(new_plant.url)
    await expect(page.locator(STIFFNESS).first).to_have_text(A_NUMBER, timeout=DATA_MS)
    new_plant.stop_daq()
    source = page.locator("[data-unit=U1] .source")
    await expect(source.locator(".mark")).to_have_attribute("data-look", "bad", timeout=DATA_MS)
    await expect(source.locator(".mark")).to_contain_text("Not connected")
    await expect(source.locator(".data-age")).to_have_attribute("data-current", "false")
    for quality in await page.locator(".quality .mark").all():
        await expect(quality).to_have_text("Bad: not connected")
    assert await page.evaluate(NO_NUMBER)
    before_s = await data_age_s(page)
    await page.wait_for_function(AGE_ABOVE, arg=before_s + 2)
    await picture_of(page, "overview")

    await page.goto(new_plant.url + BEARING)
    await expect(page.locator(".bearing-head .state .mark")).to_have_text("Bad: not connected")
    assert await page.evaluate(NO_NUMBER)
    for name in ("orbit", "spectrum", "stiffness-trend"):
        caption = page.locator(f"[data-chart={name}] figcaption")
        await expect(caption).to_contain_text("Not current: not connected.", timeout=DATA_MS)
    await picture_of(page, "bearing")


@pytest.mark.long
async def test_a_restarted_service_comes_back_without_a_reload(new_plant, page, picture_of) -> None:
    new_plant.start_daq()
    new_plant.start_service()
    await page.goto(new_plant.url + BEARING)
    await expect(page.locator(STIFFNESS)).to_have_text(A_NUMBER, timeout=DATA_MS)
    await page.evaluate("window.neverReloaded = true")

    new_plant.stop_service()
    await expect(page.locator("#failure")).to_contain_text("Service not reachable")
    await page.wait_for_function(AGE_ABOVE, arg=await data_age_s(page) + 2)  # counted here alone
    await expect(page.locator("#failure-age")).to_contain_text(
        "No number is shown", timeout=DATA_MS
    )
    assert await page.evaluate(NO_NUMBER)
    await expect(page.locator(".state .mark")).to_have_text("Bad: service not reachable")
    await picture_of(page, "down")

    new_plant.start_service()
    await expect(page.locator("#banner")).to_be_hidden(timeout=DATA_MS)
    await expect(page.locator(STIFFNESS)).to_have_text(A_NUMBER, timeout=DATA_MS)
    for name in ("orbit", "spectrum", "stiffness-trend", "amplitude-trend", "centre"):
        caption = page.locator(f"[data-chart={name}] figcaption")
        await expect(caption).to_be_visible(timeout=DATA_MS)
        await expect(caption.locator(".mark")).to_be_hidden(timeout=DATA_MS)
    assert await page.evaluate("window.neverReloaded")


async def test_a_plant_without_daq_has_a_sentence_in_place_of_every_chart(
    new_plant, page, picture_of
) -> None:
    new_plant.start_service()
    await page.goto(new_plant.url + BEARING)
    await expect(page.locator(".state .mark")).to_have_text("Bad: not connected", timeout=DATA_MS)
    for chart in await page.locator("figure").all():
        await expect(chart.locator(".sentence")).to_contain_text(
            re.compile("not connected|No samples come"), timeout=DATA_MS
        )
        await expect(chart.locator(".chart")).to_be_hidden()
    assert await page.evaluate(NO_NUMBER)
    await picture_of(page, "bearing")
