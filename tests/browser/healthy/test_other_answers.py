"""Pages while nothing is wrong, while nothing answers, and over the answers of twenty units."""

import copy
import re
from typing import Any

from on_screen import A_NUMBER, CHARTS, NO_NUMBER, assert_fits, await_older
from playwright.async_api import Route, expect

BEARING = "#/units/U1/bearings/LJB"
STIFFNESS = "[data-reading=stiffness_xx_n_per_m] .number"
N_UNITS = 20
LOST = 7
SIZE = "[document.documentElement.scrollWidth, document.documentElement.scrollHeight]"


async def test_a_service_out_of_reach_comes_back_without_a_reload(plant, page):
    await page.goto(plant.url + BEARING)
    await expect(page.locator(STIFFNESS)).to_have_text(A_NUMBER)
    await page.evaluate("window.neverReloaded = true")
    await page.context.set_offline(True)
    try:
        await expect(page.locator("#failure")).to_contain_text("Service not reachable")
        await await_older(page, 2)  # counted here alone
        said = page.locator("#failure-age")
        await expect(said).to_contain_text("No number is shown")
        assert await page.evaluate(NO_NUMBER)
        await expect(page.locator(".state .mark")).to_have_text("Bad: service not reachable")
        await page.goto(plant.url + "#/alarms")
        await expect(page.locator("#alarms")).to_contain_text("Alarms unknown")
    finally:
        await page.context.set_offline(False)

    await expect(page.locator("#banner")).to_be_hidden()
    await expect(page.locator("#alarms")).to_contain_text("No alarms")
    await page.goto(plant.url + BEARING)
    await expect(page.locator(STIFFNESS)).to_have_text(A_NUMBER)
    for name in CHARTS:
        caption = page.locator(f"[data-chart={name}] figcaption")
        await expect(caption).to_be_visible()
        await expect(caption.locator(".mark")).to_be_hidden()
    assert await page.evaluate("window.neverReloaded")


async def test_a_list_of_alarms_says_how_old_it_is(plant, page):
    await page.goto(plant.url + "#/alarms")
    await expect(page.locator("#alarms")).to_contain_text("No alarms")
    await page.route("**/api/v1/**", lambda route: route.abort())
    mark = page.locator(".alarms-head .mark")
    await expect(mark).to_contain_text("what has happened since is not")


def unit_of(unit: dict[str, Any], number: int) -> dict[str, Any]:
    another = copy.deepcopy(unit) | {"id": f"U{number}", "name": f"Unit {number}"}
    if number == LOST:
        another["source"]["state"] = "not_connected"
    return another


async def twenty_of_one(route: Route) -> None:
    """The overview of a plant of one unit, with that unit twenty times."""
    asked = {**route.request.headers, "if-none-match": '"none"'}
    answer = await route.fetch(url=route.request.url.partition("?")[0], headers=asked)
    overview = await answer.json()
    unit = overview["units"][0]
    overview["units"] = [unit_of(unit, number) for number in range(1, N_UNITS + 1)]
    await route.fulfill(json=overview)


async def as_of_the_one(route: Route) -> None:
    """What the unit that there is answers, as if the eighth of twenty did."""
    asked = {**route.request.headers, "if-none-match": '"none"'}
    await route.fulfill(
        response=await route.fetch(url=route.request.url.replace("/U8", "/U1"), headers=asked)
    )


async def test_twenty_units_stand_on_the_screen_of_a_control_room_at_once(plant, page):
    await page.route("**/api/v1/overview*", twenty_of_one)
    await page.goto(plant.url)
    await expect(page.locator(".unit-tile")).to_have_count(N_UNITS)
    stiffness = page.locator("[data-unit=U20] [data-bearing=UJB] .number").first
    await expect(stiffness).not_to_have_text("—")
    width, height = await page.evaluate(SIZE)
    assert (width, height) == (1280, 800)
    marks = page.locator(f"[data-unit=U{LOST}] .tile-head .mark").filter(visible=True)
    lost = marks.filter(has_text="Not connected")
    await expect(lost).to_be_visible()
    await expect(lost).to_have_attribute("data-look", "bad")
    well = page.locator("[data-unit=U8] .tile-head .mark").filter(visible=True)
    await expect(well).to_have_count(0)
    await page.set_viewport_size({"width": 360, "height": 780})
    await assert_fits(page)
    await page.route("**/api/v1/units/U8**", as_of_the_one)
    await page.get_by_role("link", name="Unit 8").click()
    await expect(page.locator("h1")).to_contain_text("Unit 8")


NOT_WATCHED = "This film is not watched: operating states require power_channel and rated_power_mw."


async def test_pages_without_contents_say_why(plant, page, complaints):
    await page.goto(plant.url)
    link = page.locator("#alarms")
    await expect(link).to_contain_text("No alarms")
    await link.click()
    await expect(page.locator("h1")).to_have_text("Alarms")
    await expect(page.get_by_text("No alarms.")).to_be_visible()
    await expect(link).to_have_attribute("aria-current", "page")
    line = page.locator(".alarm-rates")
    await expect(line).to_contain_text("Last 7 days: 0 alarms (0.0/day, peak 0 per 10 min).")
    await expect(line).to_contain_text("Chattering 0, fleeting 0, stale 0.")

    await page.goto(plant.url + "#/recordings")
    await expect(page.locator(".recordings")).to_contain_text("None yet. When an alarm is raised")
    await expect(page.locator(".reports")).to_contain_text("None yet: no alarm has been raised.")
    await page.goto(plant.url + "#/access")
    await expect(page.locator(".accounts")).to_contain_text("No account yet")
    await expect(page.locator(".keys")).to_contain_text("No key yet")
    assert complaints == []


async def test_a_source_in_good_health_says_what_arrives_from_where(plant, page, complaints):
    await page.goto(plant.url + "#/sources")
    row = page.locator("[data-source=U1]")
    await expect(row.locator(".mark").first).to_have_text("Connected")
    await expect(row.locator("[data-head=Missing]")).to_have_text("0")
    await expect(page.get_by_text("1 of 1 connected.")).to_be_visible()
    await row.get_by_role("button", name="Details").focus()
    await page.keyboard.press("Enter")
    facts = page.locator("#source-U1")
    await expect(facts).to_contain_text("Modbus, block ring")
    await expect(facts).to_contain_text("127.0.0.1:")
    await expect(facts).to_contain_text("Not checked: the plant file gives none")
    await expect(row.locator("[data-head=Poll]")).to_contain_text("s")
    [source] = await (await page.request.get(f"{plant.url}api/v1/sources")).json()
    shown = await row.locator("[data-head=Received]").inner_text()
    assert 0 < int(re.sub(r"\D", "", shown)) <= source["n_stored"] + source["n_flagged"]
    await row.get_by_role("link").click()
    await expect(page.locator("h1")).to_contain_text("Unit 1")
    assert complaints == []


async def test_a_film_that_is_not_watched_says_why_in_place_of_every_chart(plant, page, complaints):
    await page.goto(plant.url + "#/units/U1/bearings/UJB/film")
    await expect(page.locator(".film-verdict .sentence")).to_have_text(NOT_WATCHED)
    for name in ("baseline-map", "against-eccentricity_ratio", "against-oil_temperature_c"):
        await expect(page.locator(f"[data-chart={name}] .sentence")).to_have_text(NOT_WATCHED)
    await page.goto(plant.url)
    await expect(page.locator("[data-bearing=UJB] .film-brief")).to_have_text("Not watched")
    assert complaints == []
