"""The dashboard without a mouse: skip link, visible focus, an alarm acknowledged and shelved."""

from on_screen import DATA_MS, tab_to
from playwright.async_api import Page, expect

LIST = "#/alarms"
LINK = "[data-alarm='U1:link:link_lost']"

SAYS = """
wanted =>
  (document.activeElement.ariaLabel || document.activeElement.textContent).trim() === wanted
"""
IN_MAIN = "document.getElementById('main').contains(document.activeElement)"
OUTLINE = "parseFloat(getComputedStyle(document.activeElement).outlineWidth)"


async def tab_in_sight(page: Page, wanted: str) -> None:
    await tab_to(page, SAYS, wanted)
    assert await page.evaluate(OUTLINE) > 0, f"nobody sees that {wanted} has the focus"


async def test_the_first_key_leads_past_the_bar(guarded_plant, page) -> None:
    await page.goto(guarded_plant.url + LIST)
    await expect(page.locator(LINK)).to_be_visible(timeout=DATA_MS)
    await page.keyboard.press("Tab")
    await expect(page.get_by_text("Skip to the numbers")).to_be_focused()
    await page.keyboard.press("Enter")
    await page.keyboard.press("Tab")
    assert await page.evaluate(IN_MAIN)


async def test_an_alarm_is_acknowledged_shelved_and_brought_back_by_keys_alone(
    guarded_plant, page, picture_of
) -> None:
    await page.goto(guarded_plant.url + LIST)
    row = page.locator(LINK)
    await expect(row).to_be_visible(timeout=DATA_MS)
    done = page.locator(".done")
    await page.get_by_label("Your name").focus()
    await page.keyboard.type("A. Name")

    await tab_in_sight(page, "Acknowledge")
    await page.keyboard.press("Enter")
    await expect(row).to_have_attribute("data-state", "acknowledged")
    await expect(done).to_have_text("U1, Link lost: acknowledged.")
    await expect(row.get_by_role("button", name="Shelve…")).to_be_focused()

    await page.keyboard.press("Enter")
    await expect(page.get_by_label("Why it is shelved")).to_be_focused()
    await page.keyboard.press("Escape")
    await expect(row.get_by_role("button", name="Shelve…")).to_be_focused()
    await page.keyboard.press("Enter")
    await page.keyboard.type("the DAQ is being changed")
    await picture_of(page, "shelving")
    await page.keyboard.press("Enter")
    shelved = page.get_by_role("table", name="Taken off the list").locator(LINK)
    await expect(shelved).to_contain_text("Shelved by A. Name until")
    await expect(done).to_have_text("U1, Link lost: shelved.")
    await expect(page.locator("h1")).to_be_focused()

    await tab_in_sight(page, "Unshelve")
    await page.keyboard.press("Enter")
    await expect(page.get_by_role("table", name="On the list").locator(LINK)).to_be_visible()
    await expect(page.locator("h1")).to_be_focused()
