"""A service that cannot be reached: no number passes for a current one until it answers again."""

from on_screen import A_NUMBER, CHARTS, NO_NUMBER, await_older
from playwright.async_api import expect

BEARING = "#/units/U1/bearings/LJB"
STIFFNESS = "[data-reading=stiffness_xx_n_per_m] .number"


async def test_a_service_out_of_reach_comes_back_without_a_reload(plant, page) -> None:
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


async def test_a_list_of_alarms_says_how_old_it_is(plant, page) -> None:
    await page.goto(plant.url + "#/alarms")
    await expect(page.locator("#alarms")).to_contain_text("No alarms")
    await page.route("**/api/v1/**", lambda route: route.abort())
    mark = page.locator(".alarms-head .mark")
    await expect(mark).to_contain_text("what has happened since is not")
