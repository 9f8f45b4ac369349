"""The page of a unit: its bearings side by side, what is wrong with it, and the way on."""

from on_screen import A_NUMBER
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
    plant, page, complaints
) -> None:
    heard = overviews_of(page)
    await page.goto(plant.url + UNIT)
    table = page.get_by_role("table", name="side by side")
    await expect(table.locator(OIL)).to_have_count(3)
    await expect(table.locator(OIL).first).to_have_text(A_NUMBER)
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
    assert complaints == []
