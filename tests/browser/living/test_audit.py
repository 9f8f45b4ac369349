"""The page of the audit trail: who did what to what, found again by keyboard."""

from playwright.async_api import expect

AUDIT = "#/audit"


async def test_the_trail_tells_what_the_service_has_written_and_the_keyboard_finds_it(
    plant, page, complaints
) -> None:
    told = await (await page.request.get(f"{plant.url}api/v1/audit?limit=100")).json()
    await page.goto(plant.url + AUDIT)
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
