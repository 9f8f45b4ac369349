"""The page of the audit trail: who did what to what, found again by keyboard."""

from on_screen import DATA_MS, assert_fits
from playwright.async_api import expect

AUDIT = "#/audit"

WORDS = """
async (entry) => {
  const { changeLines, objectWords } = await import("/static/audit_words.js");
  return [objectWords(entry), changeLines(entry)];
}
"""

CHAIN = """
async (entries) => {
  const { chainWords } = await import("/static/audit_words.js");
  return chainWords(entries).look;
}
"""


async def test_the_trail_tells_what_the_service_has_written(
    living_plant, page, complaints_of, picture_of
) -> None:
    complaints = complaints_of(page)
    told = await (await page.request.get(f"{living_plant.url}api/v1/audit?limit=100")).json()
    await page.goto(living_plant.url + AUDIT)
    rows = page.locator("[data-entry]")
    await expect(rows).to_have_count(len(told["entries"]), timeout=DATA_MS)
    accepted = page.locator("[data-entry]", has_text="baseline accepted").first
    await expect(accepted).to_contain_text("in force: none → 1")
    await expect(accepted).to_contain_text(", version 1")
    await expect(page.locator(".page-head .mark")).to_have_attribute("data-look", "good")
    await picture_of(page, "audit")
    assert complaints == []


async def test_the_keyboard_finds_what_somebody_did(living_plant, page) -> None:
    await page.goto(living_plant.url + AUDIT)
    await expect(page.locator("[data-entry]").first).to_be_visible(timeout=DATA_MS)
    await page.get_by_label("To what").fill("service")
    await page.keyboard.press("Enter")
    await expect(page.locator("[data-entry]")).to_have_count(1)
    await expect(page.locator("[data-entry]")).to_contain_text("service started")
    await page.get_by_label("Who").fill("nobody of that name")
    await page.keyboard.press("Enter")
    await expect(page.get_by_text("No entry fits.")).to_be_visible()
    await page.get_by_role("button", name="Clear").press("Enter")
    await expect(page.locator("[data-entry]").nth(1)).to_be_visible()


async def test_before_and_after_are_told_in_words_and_a_broken_chain_is_seen(
    running_plant, page
) -> None:
    await page.goto(running_plant.url)
    shelved = {
        "action": "alarm.shelved",
        "object": "U1:UJB:order1_shaft_x",
        "before": {"state": "unacknowledged", "level": "alert"},
        "after": {"state": "shelved", "level": "alert", "until_ns": None},
    }
    where, changes = await page.evaluate(WORDS, shelved)
    assert where == "U1 UJB: Shaft vibration 1×, x"
    assert changes == ["state: unacknowledged → shelved"]
    chain = [
        {"number": 3, "hash": "c", "previous_hash": "b"},
        {"number": 2, "hash": "b", "previous_hash": "a"},
        {"number": 1, "hash": "a", "previous_hash": "0"},
    ]
    assert await page.evaluate(CHAIN, chain) == "good"
    assert await page.evaluate(CHAIN, [chain[0], chain[2]]) == "absent"
    chain[1]["hash"] = "x"
    assert await page.evaluate(CHAIN, chain) == "bad"


async def test_the_audit_trail_fits_a_phone(running_plant, phone_page) -> None:
    await phone_page.goto(running_plant.url + AUDIT)
    await expect(phone_page.locator("[data-entry]").first).to_be_visible(timeout=DATA_MS)
    await assert_fits(phone_page)
