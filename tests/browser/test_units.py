"""The page of a unit: its bearings side by side, what is wrong with it, and the way on."""

from on_screen import A_NUMBER, DATA_MS, assert_fits
from playwright.async_api import Page, Response, expect

UNIT = "#/units/U1"
HREFS = "links => links.map(link => link.getAttribute('href'))"
LEADS_SOMEWHERE = """
async (addresses) => {
  const { routeOf } = await import("/static/route.js");
  const { PAGES } = await import("/static/pages.js");
  return addresses.map((address) => routeOf(address, PAGES) !== null);
}
"""
OIL = "[data-reading=oil_temperature_c] .number"


def overviews_of(page: Page) -> list[Response]:
    """Answers about the plant that the page gets from now on."""
    heard: list[Response] = []
    page.on("response", lambda answer: "/v1/overview" in answer.url and heard.append(answer))
    return heard


async def test_bearings_stand_side_by_side_with_the_numbers_of_the_service(
    living_plant, page, complaints_of, picture_of
) -> None:
    complaints, heard = complaints_of(page), overviews_of(page)
    await page.goto(living_plant.url + UNIT)
    table = page.get_by_role("table", name="side by side")
    await expect(table.locator(OIL)).to_have_count(3)
    await expect(table.locator(OIL).first).to_have_text(A_NUMBER, timeout=DATA_MS)
    shown = await table.locator(OIL).all_inner_texts()
    told = set()
    for answer in [one for one in heard if one.status == 200]:
        bearings = (await answer.json())["units"][0]["bearings"]
        oils = [bearing["readings"]["oil_temperature_c"]["value"] for bearing in bearings]
        told.add(tuple("—" if oil is None else f"{oil:.1f}" for oil in oils))
    assert tuple(shown) in told
    heads = await table.get_by_role("columnheader").all_inner_texts()
    assert heads == ["UJB", "LJB", "TJB"]
    await expect(page.locator(".operating-state")).to_contain_text("oad")
    await expect(table.locator(".centre-picture").first).to_be_visible()
    await expect(table.locator(".film-line .mark").first).to_be_visible()
    await expect(page.locator(".unit-alarms")).not_to_contain_text("Asking the service.")
    await expect(page.locator(".unit-recordings")).not_to_contain_text("Asking the service.")
    ways = await table.locator(".ways a").evaluate_all(HREFS)
    assert len(ways) == 15
    assert all(await page.evaluate(LEADS_SOMEWHERE, ways))
    await picture_of(page, "unit")
    assert complaints == []


async def test_the_keyboard_leads_from_the_plant_to_a_unit_and_to_its_bearing(
    running_plant, page
) -> None:
    await page.goto(running_plant.url)
    await page.get_by_role("link", name="Unit 1").focus()
    await page.keyboard.press("Enter")
    await expect(page.locator("h1")).to_contain_text("Unit 1")
    await page.get_by_role("link", name="UJB").focus()
    await page.keyboard.press("Enter")
    await expect(page.locator("h1")).to_contain_text(", UJB")


async def test_a_unit_fits_a_phone(running_plant, phone_page) -> None:
    await phone_page.goto(running_plant.url + UNIT)
    await expect(phone_page.locator(OIL).first).to_have_text(A_NUMBER, timeout=DATA_MS)
    await assert_fits(phone_page)


async def test_an_unknown_unit_is_named_and_leads_back(running_plant, page) -> None:
    await page.goto(running_plant.url + "#/units/U9")
    await expect(page.get_by_text("This plant has no unit U9.")).to_be_visible()
    await page.locator("main").get_by_role("link", name="Overview").click()
    await expect(page.locator("[data-unit=U1]")).to_be_visible()


PLACES = """
async (alarms) => {
  const { alarmPlace } = await import("/static/alarm_place.js");
  return alarms.map(alarmPlace);
}
"""


async def test_an_alarm_leads_to_where_most_is_told_about_it(running_plant, page) -> None:
    await page.goto(running_plant.url)
    bearing = ("order1_shaft_x", "zone_bearing_y", "oil_temperature", "gap_x", "opposite_gap_y")
    alarms = [("stiffness_x", "UJB"), ("channel_not_ok", "a"), ("link_lost", "link")]
    alarms += [(kind, "UJB") for kind in bearing]
    told = [{"unit": "U1", "subject": subject, "kind": kind} for kind, subject in alarms]
    found = await page.evaluate(PLACES, told)
    place = "#/units/U1/bearings/UJB"
    assert found == [f"{place}/film", "#/units/U1", "#/sources", *([place] * len(bearing))]
