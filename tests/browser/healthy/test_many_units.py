"""A plant of twenty units: all on one screen, and what is wrong stands out."""

import copy
from typing import Any

from on_screen import assert_fits
from playwright.async_api import Route, expect

N_UNITS = 20
LOST = 7
SIZE = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"


def unit_of(unit: dict[str, Any], number: int) -> dict[str, Any]:
    another = copy.deepcopy(unit) | {"id": f"U{number}", "name": f"Unit {number}"}
    if number == LOST:
        another["source"]["state"] = "not_connected"
    return another


async def twenty_of_one(route: Route) -> None:
    """The overview of a plant of one unit, with that unit twenty times."""
    asked = {**route.request.headers, "if-none-match": '"none"'}
    answer = await route.fetch(headers=asked)
    overview = await answer.json()
    unit = overview["units"][0]
    overview["units"] = [unit_of(unit, number) for number in range(1, N_UNITS + 1)]
    await route.fulfill(json=overview)


async def test_twenty_units_stand_on_the_screen_of_a_control_room_at_once(plant, page) -> None:
    await page.route("**/api/v1/overview", twenty_of_one)
    await page.goto(plant.url)
    await expect(page.locator(".unit-tile")).to_have_count(N_UNITS)
    stiffness = page.locator("[data-unit=U20] [data-bearing=UJB] .number").first
    await expect(stiffness).not_to_have_text("—")
    width, height = await page.evaluate(SIZE)
    assert (width, height) == (1280, 800)
    lost = page.locator(f"[data-unit=U{LOST}] .tile-head .mark").filter(visible=True)
    await expect(lost).to_have_text("Not connected")
    await expect(lost).to_have_attribute("data-look", "bad")
    well = page.locator("[data-unit=U8] .tile-head .mark").filter(visible=True)
    await expect(well).to_have_count(0)
    await page.set_viewport_size({"width": 360, "height": 780})
    await assert_fits(page)
    await page.get_by_role("link", name="Unit 8").click()
    await expect(page.locator("h1")).to_contain_text("Unit 8")
