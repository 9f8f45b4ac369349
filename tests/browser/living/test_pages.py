"""Pages of a plant with a past: audit trail, bearings of a unit side by side, and on a phone."""

from on_screen import A_NUMBER, FILES, assert_fits, await_charts, freeze
from playwright.async_api import expect

BEARING = "#/units/U1/bearings/UJB"
WIDEST = {
    BEARING: ".verdict .mark",
    f"{BEARING}/film": "[data-chart=baseline-map] .heatmaplayer image",
    "#/trends?b=U1/UJB&b=U1/LJB&q=stiffness_xx_n_per_m&q=speed_rpm&last=2592000": (
        "[data-chart=trend-film-stiffness-gn-m] .chart .scatterlayer .trace path.js-line"
    ),
}
HREFS = "links => links.map(link => link.getAttribute('href'))"
LEADS_SOMEWHERE = """
async ([files, addresses]) => {
  const { routeOf } = await import(`${files}route.js`);
  const { PAGES } = await import(`${files}pages.js`);
  return addresses.map((address) => routeOf(address, PAGES) !== null);
}
"""


async def test_the_trail_tells_what_the_service_has_written_and_the_keyboard_finds_it(
    plant, page, complaints
) -> None:
    told = await (await page.request.get(f"{plant.url}api/v1/audit?limit=100")).json()
    await page.goto(plant.url + "#/audit")
    rows = page.locator("[data-entry]")
    await expect(rows).to_have_count(len(told["entries"]))
    accepted = page.locator("[data-entry]", has_text="baseline accepted").first
    await expect(accepted).to_contain_text("in force: none → 1")
    await expect(accepted).to_contain_text(", version 1")
    await expect(page.locator(".page-head .mark")).to_have_attribute("data-look", "good")

    await page.get_by_label("To what").fill("service")
    await page.keyboard.press("Enter")
    await expect(page.locator("[data-entry]")).to_have_count(1)
    await expect(page.locator("[data-entry]")).to_contain_text("service started")
    await page.get_by_label("Who").fill("nobody of that name")
    await page.keyboard.press("Enter")
    await expect(page.get_by_text("No entry fits.")).to_be_visible()
    await page.get_by_role("button", name="Clear").press("Enter")
    await expect(page.locator("[data-entry]").nth(1)).to_be_visible()
    assert complaints == []


async def test_bearings_stand_side_by_side_with_the_numbers_of_the_service(
    plant, page, complaints
) -> None:
    await page.goto(plant.url + "#/units/U1")
    table = page.get_by_role("table", name="side by side")
    oil = table.locator("[data-reading=oil_temperature_c] .number")
    await expect(oil).to_have_text([A_NUMBER] * 3)
    bearings = (await freeze(page, plant.url))["units"][0]["bearings"]
    await page.reload()
    oils = [bearing["readings"]["oil_temperature_c"]["value"] for bearing in bearings]
    await expect(oil).to_have_text([f"{value:.1f}" for value in oils])
    heads = await table.get_by_role("columnheader").all_inner_texts()
    assert heads == ["UJB", "LJB", "TJB"]
    await expect(page.locator(".operating-state")).to_contain_text("oad")
    await expect(table.locator(".centre-picture").first).to_be_visible()
    await expect(table.locator(".film-line .mark").first).to_be_visible()
    await expect(page.locator(".unit-alarms")).not_to_contain_text("Asking the service.")
    await expect(page.locator(".unit-recordings")).not_to_contain_text("Asking the service.")
    ways = await table.locator(".ways a").evaluate_all(HREFS)
    assert len(ways) == 15
    assert all(await page.evaluate(LEADS_SOMEWHERE, [FILES, ways]))
    assert complaints == []


async def test_films_and_trends_fit_a_phone(plant, phone_page) -> None:
    for address, widest in WIDEST.items():
        await phone_page.goto(plant.url + address)
        await expect(phone_page.locator(widest).first).to_be_attached()
        if address == BEARING:
            await await_charts(phone_page)
        await assert_fits(phone_page)
