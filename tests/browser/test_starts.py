"""Plants that are started and stopped by the test: the first account, a DAQ and a service away."""

import pytest
from on_screen import A_NUMBER, CHARTS, DATA_MS, NO_NUMBER
from playwright.async_api import expect
from rigs.tiers import fast_and_long

pytestmark = pytest.mark.asyncio(loop_scope="session")

ALARMS = "#/alarms"
BEARING = "#/units/U1/bearings/LJB"
STIFFNESS = "[data-reading=stiffness_xx_n_per_m] .number"


@pytest.mark.parametrize("n_restarts", fast_and_long(0, 1))
async def test_the_first_account_is_made_with_the_token_and_lasts_over_a_restart(
    new_plant, page, password, complaints_of, picture_of, n_restarts
) -> None:
    new_plant.settings += "[access]\nlogin = true\n"
    new_plant.start_service()
    complaints = complaints_of(page)
    await page.goto(new_plant.url + ALARMS)
    await expect(page.get_by_role("heading", name="Set up padwatch")).to_be_visible()
    await page.get_by_label("Token").fill(new_plant.token)
    await page.get_by_label("Your name").fill("anna")
    await page.get_by_label("Password", exact=True).fill(password)
    await page.get_by_label("Password again").fill("another than that")
    await page.keyboard.press("Enter")
    await expect(page.get_by_role("alert")).to_contain_text("are not the same")
    await picture_of(page, "set-up")
    await page.get_by_label("Password again").fill(password)
    await page.keyboard.press("Enter")
    await expect(page.locator(".person")).to_contain_text("anna, admin", timeout=DATA_MS)
    await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
    assert complaints == []

    for _ in range(n_restarts):
        new_plant.stop_service()
        await expect(page.locator("#failure")).to_contain_text("Service not reachable")
        new_plant.start_service()
        await expect(page.locator("#banner")).to_be_hidden(timeout=DATA_MS)
        await expect(page.locator(".person")).to_contain_text("anna, admin")
        await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()


@pytest.mark.long
async def test_a_stopped_daq_and_a_stopped_service_come_back_without_a_reload(
    new_plant, page
) -> None:
    new_plant.start_daq()
    new_plant.start_service()
    await page.goto(new_plant.url + BEARING)
    state, number = page.locator(".state .mark"), page.locator(STIFFNESS)
    await expect(number).to_have_text(A_NUMBER, timeout=DATA_MS)
    await page.evaluate("window.neverReloaded = true")

    new_plant.stop_daq()
    await expect(state).to_have_text("Bad: not connected", timeout=DATA_MS)
    assert await page.evaluate(NO_NUMBER)
    new_plant.start_daq()
    await expect(number).to_have_text(A_NUMBER, timeout=DATA_MS)

    new_plant.stop_service()
    await expect(page.locator("#failure")).to_contain_text("Service not reachable")
    said = page.locator("#failure-age")
    await expect(said).to_contain_text("No number is shown", timeout=DATA_MS)
    assert await page.evaluate(NO_NUMBER)
    await expect(state).to_have_text("Bad: service not reachable")
    new_plant.start_service()
    await expect(page.locator("#banner")).to_be_hidden(timeout=DATA_MS)
    await expect(number).to_have_text(A_NUMBER, timeout=DATA_MS)
    for name in CHARTS:
        caption = page.locator(f"[data-chart={name}] figcaption")
        await expect(caption).to_be_visible(timeout=DATA_MS)
        await expect(caption.locator(".mark")).to_be_hidden(timeout=DATA_MS)
    assert await page.evaluate("window.neverReloaded")
