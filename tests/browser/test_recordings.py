"""The page of recordings and reports while there are none; with an alarm see `test_evidence`."""

from on_screen import assert_fits
from playwright.async_api import expect

RECORDINGS = "#/recordings"


async def test_a_plant_without_alarms_says_why_nothing_has_been_recorded(
    running_plant, page, complaints_of
) -> None:
    complaints = complaints_of(page)
    await page.goto(running_plant.url + RECORDINGS)
    await expect(page.locator(".recordings")).to_contain_text("None yet. When an alarm is raised")
    await expect(page.locator(".reports")).to_contain_text("None yet: no alarm has been raised.")
    assert complaints == []


async def test_recordings_fit_a_phone(running_plant, phone_page) -> None:
    await phone_page.goto(running_plant.url + RECORDINGS)
    await expect(phone_page.locator(".reports")).to_contain_text("None yet")
    await assert_fits(phone_page)
