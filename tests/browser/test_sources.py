"""The page of sources: what arrives, what is lost, and what to do about it, the worst first."""

import re

from on_screen import DATA_MS, assert_fits
from playwright.async_api import expect

SOURCES = "#/sources"
ROW = "[data-source=U1]"

JUDGE = """
async ([changes, alarms, lost]) => {
  const { troubleOf } = await import("/static/source_words.js");
  const source = { state: "connected", reason: null, data_age_s: 0.2, ...changes };
  const { rank, look, words, advice } = troubleOf(source, alarms, lost);
  return { rank, look, words, advice };
}
"""

DRIFT = {"kind": "clock_drift", "level": "alert", "is_active": True, "value": 300.0}
DRIFT |= {"limit": 200.0, "value_unit": "ppm"}


async def test_a_source_in_good_health_says_what_arrives_from_where(
    running_plant, page, complaints_of, picture_of
) -> None:
    complaints = complaints_of(page)
    await page.goto(running_plant.url + SOURCES)
    row = page.locator(ROW)
    await expect(row.locator(".mark").first).to_have_text("Connected", timeout=DATA_MS)
    await expect(row.locator("[data-head=Missing]")).to_have_text("0")
    await expect(page.get_by_text("1 of 1 connected.")).to_be_visible()
    await row.get_by_role("button", name="Details").focus()
    await page.keyboard.press("Enter")
    facts = page.locator("#source-U1")
    await expect(facts).to_contain_text("Modbus, block ring")
    await expect(facts).to_contain_text("127.0.0.1:")
    await expect(facts).to_contain_text("Not checked: the plant file gives none")
    await expect(row.locator("[data-head=Poll]")).to_contain_text("s")
    [source] = await (await page.request.get(f"{running_plant.url}api/v1/sources")).json()
    shown = await row.locator("[data-head=Received]").inner_text()
    assert 0 < int(re.sub(r"\D", "", shown)) <= source["n_stored"] + source["n_flagged"]
    await picture_of(page, "sources")
    await row.get_by_role("link").click()
    await expect(page.locator("h1")).to_contain_text("Unit 1")
    assert complaints == []


async def test_where_no_device_answers_the_page_says_so_and_what_to_do(
    new_plant, page, picture_of
) -> None:
    new_plant.start_service()
    await page.goto(new_plant.url + SOURCES)
    row = page.locator(ROW)
    await expect(row.locator(".mark").first).to_have_text("Not connected", timeout=DATA_MS)
    await expect(page.get_by_text("0 of 1 connected. Something is wrong with 1")).to_be_visible()
    await expect(page.locator(".advice")).to_contain_text("nothing listens at that port")
    await picture_of(page, "not-connected")
    await row.get_by_role("link").click()
    await expect(page.locator(".bearing-head .source")).to_contain_text("Not connected")
    table = page.get_by_role("table", name="side by side")
    await expect(table.locator(".quality .mark").first).to_contain_text("not connected")
    await expect(page.locator(".operating-state")).to_have_text("Operating state not known")


async def test_the_worst_about_a_source_is_told_with_what_to_do(running_plant, page) -> None:
    silent = {"state": "not_connected", "reason": "daq:502: no answer within 0.5 s"}
    other = {"state": "not_connected", "reason": "daq:502: its vendor is 'A', expected is 'B'"}
    nameless = {"state": "not_connected", "reason": "daq:502: no name server answers within 1.0 s"}
    unknown = "daq:502: [Errno -3] Temporary failure in name resolution"
    cases = [
        (nameless, [], 0, 0, "bad", "name of the device"),
        (nameless | {"reason": unknown}, [], 0, 0, "bad", "name of the device"),
        (silent, [], 0, 0, "bad", "switched on"),
        (other, [], 0, 0, "bad", "Another device"),
        ({"data_age_s": 12.0}, [DRIFT], 0, 1, "bad", "still samples"),
        ({"state": "unknown"}, [], 0, 1, "bad", ""),
        ({"state": "connecting"}, [], 0, 2, "uncertain", "Wait"),
        ({}, [DRIFT], 700, 3, "uncertain", "sampling rate"),
        ({}, [], 700, 4, "uncertain", "network"),
        ({"state": "ended"}, [], 0, 5, "absent", ""),
        ({}, [], 0, 9, "good", ""),
    ]
    await page.goto(running_plant.url)
    for changes, alarms, lost, rank, look, said in cases:
        found = await page.evaluate(JUDGE, [changes, alarms, lost])
        assert (found["rank"], found["look"]) == (rank, look), found
        assert said in found["advice"]


async def test_sources_fit_a_phone(running_plant, phone_page) -> None:
    await phone_page.goto(running_plant.url + SOURCES)
    await expect(phone_page.locator(ROW)).to_contain_text("Connected", timeout=DATA_MS)
    await phone_page.get_by_role("button", name="Details").click()
    await assert_fits(phone_page)
