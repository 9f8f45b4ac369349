"""A plant whose DAQ never answered: sentences in place of numbers, and recordings of before."""

import re

from on_screen import NO_NUMBER, await_orbit
from playwright.async_api import expect
from real_plant import RECORDED

LOST = re.compile("not connected|No samples come")


async def test_where_no_device_answers_every_page_says_so_and_what_to_do(plant, page):
    await page.goto(plant.url + "#/units/U1/bearings/LJB")
    await expect(page.locator(".state .mark")).to_have_text("Bad: not connected")
    for chart in await page.locator(".charts figure").all():
        await expect(chart.locator(".sentence")).to_contain_text(LOST)
        await expect(chart.locator(".chart")).to_be_hidden()
    assert await page.evaluate(NO_NUMBER)

    await page.goto(plant.url + "#/sources")
    row = page.locator("[data-source=U1]")
    await expect(row.locator(".mark").first).to_have_text("Not connected")
    await expect(page.get_by_text("0 of 1 connected. Something is wrong with 1")).to_be_visible()
    await expect(page.locator(".advice")).to_contain_text("nothing listens at that port")
    await row.get_by_role("link").click()
    await expect(page.locator(".bearing-head .source")).to_contain_text("Not connected")
    table = page.get_by_role("table", name="side by side")
    await expect(table.locator(".quality .mark").first).to_contain_text("not connected")
    await expect(page.locator(".operating-state")).to_have_text("Operating state not known")


async def test_a_recording_is_played_although_its_unit_is_not_connected(plant, page, complaints):
    await page.goto(plant.url + "#/units/U1/bearings/UJB/orbits")
    await expect(page.locator(".player .sentence")).to_contain_text("No sample of this unit")
    await expect(page.locator("#orbit-source option")).to_have_count(2)
    await page.locator("#orbit-source").select_option(RECORDED)
    await await_orbit(page)

    await page.locator("#orbit-at").fill("50")
    await expect(page.locator(".player .facts")).to_contain_text("00:00:5")
    await expect(page.locator(".player .facts")).to_contain_text("92.3")

    await page.reload()  # the address names the recording
    await await_orbit(page)
    await expect(page.locator("#orbit-source")).to_have_value(RECORDED)
    await expect(page.locator(".player .facts")).to_contain_text("2026-01-01 00:00:0")
    assert complaints == []
