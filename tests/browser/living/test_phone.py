"""Pages with a long past on a phone."""

from on_screen import assert_fits, await_charts
from playwright.async_api import expect

BEARING = "#/units/U1/bearings/UJB"
WIDEST = {
    BEARING: ".verdict .mark",
    f"{BEARING}/film": "[data-chart=baseline-map] .heatmaplayer image",
    "#/trends?b=U1/UJB&b=U1/LJB&q=stiffness_xx_n_per_m&q=speed_rpm&last=2592000": (
        "[data-chart=trend-film-stiffness-gn-m] .chart .scatterlayer .trace path.js-line"
    ),
}


async def test_films_and_trends_fit_a_phone(plant, phone_page) -> None:
    for address, widest in WIDEST.items():
        await phone_page.goto(plant.url + address)
        await expect(phone_page.locator(widest).first).to_be_attached()
        if address == BEARING:
            await await_charts(phone_page)
        await assert_fits(phone_page)
