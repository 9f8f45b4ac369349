"""A plant that is started and stopped by the test, and its first account."""

import pytest
from playwright.async_api import expect
from real_plant import PASSWORD
from rigs.tiers import fast_and_long

ALARMS = "#/alarms"


@pytest.mark.parametrize("n_restarts", fast_and_long(0, 1))
async def test_the_first_account_is_made_with_the_token_and_lasts_over_a_restart(
    new_plant, page, complaints, n_restarts
) -> None:
    new_plant.settings += "[access]\nlogin = true\n"
    new_plant.start_service()
    await page.goto(new_plant.url + ALARMS)
    await expect(page.get_by_role("heading", name="Set up padwatch")).to_be_visible()
    await page.get_by_label("Token").fill(new_plant.token)
    await page.get_by_label("Your name").fill("anna")
    await page.get_by_label("Password", exact=True).fill(PASSWORD)
    await page.get_by_label("Password again").fill("another than that")
    await page.keyboard.press("Enter")
    await expect(page.get_by_role("alert")).to_contain_text("are not the same")
    await page.get_by_label("Password again").fill(PASSWORD)
    await page.keyboard.press("Enter")
    await expect(page.locator(".person")).to_contain_text("anna, admin")
    await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
    assert complaints == []

    for _ in range(n_restarts):
        new_plant.stop_service()
        await expect(page.locator("#failure")).to_contain_text("Service not reachable")
        new_plant.start_service()
        await expect(page.locator("#banner")).to_be_hidden()
        await expect(page.locator(".person")).to_contain_text("anna, admin")
        await expect(page.get_by_role("heading", name="Alarms", exact=True)).to_be_visible()
